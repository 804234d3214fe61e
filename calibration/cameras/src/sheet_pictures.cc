#include "semblance/cameras/sheet_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <filesystem>

#include "semblance/core/errors.h"
#include "semblance/io/image_io.h"

namespace semblance {
namespace {

constexpr std::size_t kEnoughIdentified = 5;  // pictures that show the sheet of `auto`
constexpr int kMostLookedAt = 60;

bool is_still(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

// Perhaps they show another sheet.
std::string nothing_found(const std::vector<std::string>& files, const Target& target) {
  if (target.kind == TargetKind::automatic) {
    return "no picture shows a sheet of a known kind; name yours with --target";
  }
  const std::string text = "no picture shows the sheet " + target_text(target);
  const Target seen = identify_target_in(files, {});
  if (seen.kind == TargetKind::automatic) return text + ", nor another one of a known kind";
  return fmt::format("{}: they seem to show {} (its size is not known: give yours for 1)", text,
                     target_text(seen));
}

// Pictures that show the sheet's mirror image are at fault, not the sheet's name.
void check_mirrored(const SheetPictures& pictures) {
  for (std::size_t i = 0; i < pictures.names.size(); ++i) {
    for (const DetectionWarning& warning : pictures.detections[i].warnings) {
      if (warning.kind != DetectionWarning::Kind::mirrored) continue;
      throw InvalidInput(pictures.names[i].text() + ": " + warning.text);
    }
  }
}

}  // namespace

std::string PictureName::text() const {
  return frame < 0 ? file : fmt::format("{} frame {}", file, frame);
}

void for_each_picture(const std::vector<std::string>& files, int stride,
                      const std::function<bool(const Picture&)>& use) {
  for (const std::string& file : files) {
    if (is_still(file)) {
      if (!use({{file, -1}, read_image_rgb8(file)})) return;
      continue;
    }
    VideoSource video(file);
    Picture picture{{file, 0}, {}};
    for (; video.next(picture.image); ++picture.name.frame) {
      if (picture.name.frame % stride == 0 && !use(picture)) return;
    }
  }
}

int even_stride(const std::vector<std::string>& files, int most_frames) {
  int longest = 0;
  for (const std::string& file : files) {
    if (!is_still(file)) longest = std::max(longest, VideoSource(file).info().frame_count);
  }
  return most_frames > 0 ? std::max(1, (longest + most_frames - 1) / most_frames) : 1;
}

Target identify_target_in(const std::vector<std::string>& files, const Target& automatic) {
  std::vector<Rgb8> images;
  int looked_at = 0;
  for_each_picture(files, 1, [&](const Picture& picture) {
    if (identify_target({picture.image}, automatic).kind != TargetKind::automatic) {
      images.push_back(picture.image);
    }
    return images.size() < kEnoughIdentified && ++looked_at < kMostLookedAt;
  });
  return identify_target(images, automatic);
}

int SheetPictures::found() const {
  return static_cast<int>(std::count_if(detections.begin(), detections.end(),
                                        [](const Detection& d) { return d.found(); }));
}

SheetPictures find_sheet(const std::vector<std::string>& files, const Target& target,
                         int most_frames, Progress& progress) {
  SheetPictures result;
  result.target = target.kind == TargetKind::automatic ? identify_target_in(files, target) : target;
  if (result.target.kind == TargetKind::automatic) {
    throw SolverError(nothing_found(files, target));
  }
  for (const std::string& file : files) {
    if (!is_still(file)) {
      result.frames_per_second.push_back(VideoSource(file).info().frames_per_second);
    }
  }
  Detector detector(result.target);
  progress.begin("looking for the sheet", 0);
  for_each_picture(files, even_stride(files, most_frames), [&](const Picture& picture) {
    const auto start = std::chrono::steady_clock::now();
    result.detections.push_back(detector.detect(picture.image));
    result.detect_s +=
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    result.names.push_back(picture.name);
    progress.update(static_cast<std::int64_t>(result.names.size()));
    return !progress.cancelled();
  });
  progress.end();
  if (progress.cancelled()) throw SolverError("interrupted while the sheet was looked for");
  if (result.found() > 0) return result;
  check_mirrored(result);
  throw SolverError(nothing_found(files, target));
}

}  // namespace semblance
