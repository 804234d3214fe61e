#include "semblance/pipeline/mouth_animation.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "mouth_drawing.h"
#include "mouth_files.h"
#include "mouth_painter.h"
#include "mouth_wire_overlay.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/geometry/homotopy.h"
#include "semblance/io/video.h"
#include "semblance/models/mouth_visemes.h"
#include "semblance/pipeline/overlay.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;

constexpr double usual_frames_per_second = 25.0, most_frames = 1e6;
constexpr int least_flat_side_px = 64, most_flat_side_px = 16384;

/// Runs `work`, whose messages do not know the file, and names it in them.
template <typename Work>
auto naming(const std::string& path, const Work& work) {
  try {
    return work();
  } catch (const InvalidInput& error) {
    throw InvalidInput(path + ": " + error.what());
  }
}

std::vector<int> given_rows(const LipTrack& track, const std::vector<int>& frames) {
  std::vector<int> rows;
  for (const int frame : frames) rows.push_back(find_frame(track, frame));
  std::sort(rows.begin(), rows.end());
  const auto twice = std::adjacent_find(rows.begin(), rows.end());
  if (twice != rows.end()) {
    throw InvalidInput(
        fmt::format("key frame {} is given twice: two keys at one time leave no time "
                    "to move in",
                    track.frames[*twice].frame));
  }
  return rows;
}

MouthPoints key_points(const MouthKey& key) {
  MouthPoints points(static_cast<Eigen::Index>(key.position_px.size()), 3);
  for (std::size_t i = 0; i < key.position_px.size(); ++i) {
    points.row(static_cast<Eigen::Index>(i)) << key.position_px[i].x(), key.position_px[i].y(),
        key.depth_px[i];
  }
  return points;
}

/// All that is known before anything is drawn.
struct Plan {
  LipTrack track;
  std::vector<int> rows;
  std::vector<MouthKey> keys;
  std::vector<MouthKey> still;  // the frame that gives all texture, if one does
  MouthMotion motion;
  MouthWireframe wireframe;

  static Plan make(const MouthAnimationOptions& options) {
    validate(options.choice.controls);
    std::vector<Viseme> visemes;
    if (!options.visemes.empty()) visemes = read_visemes(options.visemes);
    LipTrack read = read_lip_markers(options.markers);
    return naming(options.markers, [&] {
      LipTrack track = with_inner_contour(read);
      std::vector<int> rows = options.keys.empty() ? choose_keys(track, options.choice)
                                                   : given_rows(track, options.keys);
      std::vector<MouthKey> keys, still;
      for (const int row : rows) keys.push_back(make_key(track, row, options.choice.neighbours));
      if (options.still_frame) {
        still.push_back(
            make_key(track, find_frame(track, *options.still_frame), options.choice.neighbours));
      }
      if (visemes.empty()) visemes = builtin_visemes();
      assign_depths(visemes, keys);
      assign_depths(visemes, still);
      MouthMotion motion(keys, options.choice.controls, options.choice.reference_px);
      MouthWireframe wireframe(key_points(keys.front()), options.wireframe);
      return Plan{std::move(track), std::move(rows),   std::move(keys),
                  std::move(still), std::move(motion), std::move(wireframe)};
    });
  }
};

/// Pictures of the key frames, from the video.
std::map<int, Rgb8> key_pictures(const std::string& path, const std::set<int>& frames) {
  VideoSource video(path);
  std::map<int, Rgb8> pictures;
  for (const int frame : frames) {
    if (frame < 0) throw InvalidInput(fmt::format("{}: there is no frame {}", path, frame));
    video.skip_to(frame);
    if (!video.next(pictures[frame])) {
      throw InvalidInput(fmt::format(
          "{}: ends before key frame {}; give the video that the markers were tracked in", path,
          frame));
    }
  }
  return pictures;
}

void require_inside(const std::vector<MouthKey>& keys, const VideoInfo& info) {
  for (const MouthKey& key : keys) {
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& p : key.position_px) middle += p / double(key.position_px.size());
    if (middle.x() < 0.0 || middle.y() < 0.0 || middle.x() > info.width ||
        middle.y() > info.height) {
      throw InvalidInput(
          fmt::format("{}: the mouth of frame {} is at ({:.0f}, {:.0f}), outside the "
                      "{} x {} picture; give the video that the markers were "
                      "tracked in",
                      info.path, key.frame, middle.x(), middle.y(), info.width, info.height));
    }
  }
}

/// Draws the face at any time of the motion, in pixels shifted by `origin_px` against the markers'.
class Stage {
 public:
  virtual ~Stage() = default;
  virtual Image paint(const MouthPoints& markers, double time_s) = 0;
  bool textured = true;
  int width = 0, height = 0;
  Eigen::Vector2d origin_px = Eigen::Vector2d::Zero();
};

class FlatStage : public Stage {
 public:
  explicit FlatStage(const Plan& plan) {
    textured = false;
    Eigen::AlignedBox2d box;
    for (const MouthKey& key : plan.keys) {
      for (const Eigen::Vector2d& p : key.position_px) box.extend(p);
    }
    const double margin = mouth_frame(plan.keys.front().position_px).width_px;
    origin_px = (box.min().array() - margin).floor();
    const Eigen::Vector2d size = (box.max().array() + margin).ceil().matrix() - origin_px;
    if (!(size.maxCoeff() <= most_flat_side_px)) {
      throw InvalidInput(
          fmt::format("the markers spread over {:.0f} x {:.0f} pixels; at most {} "
                      "were expected",
                      size.x(), size.y(), most_flat_side_px));
    }
    width = std::max(least_flat_side_px, static_cast<int>(size.x()));
    height = std::max(least_flat_side_px, static_cast<int>(size.y()));
    MouthPoints first = key_points(plan.keys.front());
    first.leftCols<2>().rowwise() -= origin_px.transpose();
    painter_ = std::make_unique<MouthPainter>(plan.wireframe, first, width, height);
  }
  Image paint(const MouthPoints& markers, double) override { return painter_->paint(markers); }

 private:
  std::unique_ptr<MouthPainter> painter_;
};

class StillStage : public Stage {
 public:
  StillStage(const Plan& plan, const MouthKey& key, const Rgb8& picture)
      : painter_(plan.wireframe, key_points(key), linear_from_rgb8(picture)) {
    width = picture.width;
    height = picture.height;
  }
  Image paint(const MouthPoints& markers, double) override { return painter_.paint(markers); }

 private:
  MouthPainter painter_;
};

/// Each segment's pictures are those of both its keys, brought to one shape and blended.
class BlendedStage : public Stage {
 public:
  BlendedStage(const Plan& plan, std::map<int, Rgb8> pictures)
      : plan_(plan), pictures_(std::move(pictures)) {
    width = pictures_.begin()->second.width;
    height = pictures_.begin()->second.height;
  }

  Image paint(const MouthPoints& markers, double time_s) override {
    const int segment = plan_.motion.segment_at(time_s);
    enter(segment);
    const double start_s = plan_.keys[segment].time_s, end_s = plan_.keys[segment + 1].time_s;
    const double v = std::clamp((time_s - start_s) / (end_s - start_s), 0.0, 1.0);
    const auto share = static_cast<float>(blend_flat(v, 0.0).value);
    if (share == 0.0f) return before_->paint(markers);
    if (share == 1.0f) return after_->paint(markers);
    Image picture = before_->paint(markers);
    const Image other = after_->paint(markers);
    for (std::size_t i = 0; i < picture.data.size(); ++i) {
      picture.data[i] += share * (other.data[i] - picture.data[i]);
    }
    return picture;
  }

 private:
  void enter(int segment) {
    if (segment == segment_) return;
    before_ = segment == segment_ + 1 && after_ ? std::move(after_) : painter(segment);
    after_ = painter(segment + 1);
    segment_ = segment;
  }
  std::unique_ptr<MouthPainter> painter(int key) const {
    return std::make_unique<MouthPainter>(plan_.wireframe, key_points(plan_.keys[key]),
                                          linear_from_rgb8(pictures_.at(plan_.keys[key].frame)));
  }

  const Plan& plan_;
  std::map<int, Rgb8> pictures_;
  int segment_ = -2;
  std::unique_ptr<MouthPainter> before_, after_;
};

std::unique_ptr<Stage> make_stage(const Plan& plan, const MouthAnimationOptions& options) {
  if (options.video.empty()) return std::make_unique<FlatStage>(plan);
  const std::vector<MouthKey>& shown = plan.still.empty() ? plan.keys : plan.still;
  require_inside(shown, VideoSource(options.video).info());
  std::set<int> frames;
  for (const MouthKey& key : shown) frames.insert(key.frame);
  std::map<int, Rgb8> pictures = key_pictures(options.video, frames);
  if (plan.still.empty()) return std::make_unique<BlendedStage>(plan, std::move(pictures));
  return std::make_unique<StillStage>(plan, plan.still.front(), pictures.begin()->second);
}

double output_rate(const MouthAnimationOptions& options) {
  if (options.frames_per_second != 0.0) return options.frames_per_second;
  const double rate =
      options.video.empty() ? 0.0 : VideoSource(options.video).info().frames_per_second;
  return rate > 0.0 ? rate : usual_frames_per_second;
}

/// The lips in 3-D, with the first picture for their texture.
void write_glb_of(const Plan& plan, Stage& stage, const std::vector<double>& times_s,
                  const std::string& path) {
  MouthPoints markers;
  plan.motion.at(times_s.front(), markers);
  std::optional<Rgb8> texture;
  if (stage.textured) texture = rgb8_from_linear(stage.paint(markers, times_s.front()));
  const PictureSpace space(stage.width, stage.height,
                           mouth_frame(plan.keys.front().position_px).width_px);
  write_mouth_glb(path, plan.wireframe, plan.motion, times_s, space, texture);
}

void draw(const Plan& plan, Stage& stage, const std::vector<double>& times_s, double rate,
          const fs::path& folder, Progress& progress) {
  VideoWriter plain((folder / "animation.mp4").string(), stage.width, stage.height, rate);
  MouthWireOverlay overlay(plan.wireframe, stage.width, stage.height);
  VideoWriter wired((folder / "wireframe.mp4").string(), overlay.width(), overlay.height(), rate);
  MouthPoints markers;
  progress.begin("animate", static_cast<std::int64_t>(times_s.size()));
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    if (progress.cancelled()) throw SolverError("the animation was cancelled");
    plan.motion.at(times_s[i], markers);
    markers.leftCols<2>().rowwise() -= stage.origin_px.transpose();
    const Rgb8 picture = rgb8_from_linear(stage.paint(markers, times_s[i]));
    plain.write(picture);
    const int segment = plan.motion.segment_at(times_s[i]);
    wired.write(overlay.paint(picture, markers,
                              fmt::format("{:.2f} s   key frames {} - {}", times_s[i],
                                          plan.keys[segment].frame, plan.keys[segment + 1].frame)));
    progress.update(static_cast<std::int64_t>(i) + 1);
  }
  progress.end();
  plain.close();
  wired.close();
}

}  // namespace

std::vector<double> animation_times(double start_s, double end_s, double frames_per_second) {
  if (!(frames_per_second > 0.0) || !std::isfinite(frames_per_second)) {
    throw InvalidInput(
        fmt::format("{} frames per second; a positive rate was expected", frames_per_second));
  }
  const double steps = std::max(1.0, std::round((end_s - start_s) * frames_per_second));
  if (!(steps < most_frames)) {
    throw InvalidInput(
        fmt::format("{} s at {} frames per second are more than {} frames; choose a "
                    "lower rate or fewer key frames",
                    end_s - start_s, frames_per_second, most_frames));
  }
  std::vector<double> times_s;
  for (int k = 0; k <= static_cast<int>(steps); ++k) {
    times_s.push_back(start_s + (end_s - start_s) * k / steps);
  }
  times_s.back() = end_s;
  return times_s;
}

MouthAnimationSummary animate_mouth(const MouthAnimationOptions& options, Progress& progress) {
  const auto begin = std::chrono::steady_clock::now();
  const Plan plan = Plan::make(options);
  const double rate = output_rate(options);
  const std::vector<double> times_s =
      animation_times(plan.motion.start_s(), plan.motion.end_s(), rate);
  const std::unique_ptr<Stage> stage = make_stage(plan, options);
  prepare_output_folder(options.folder);
  const fs::path folder(options.folder);
  draw(plan, *stage, times_s, rate, folder, progress);
  write_lip_markers((folder / "animation.csv").string(),
                    animated_track(plan.track, plan.rows, plan.motion, times_s));
  write_wireframe_json((folder / "wireframe.json").string(), plan.wireframe, plan.motion, plan.keys,
                       times_s);
  write_glb_of(plan, *stage, times_s, (folder / "mouth.glb").string());
  write_paths_svg((folder / "paths.svg").string(), plan.keys, plan.motion,
                  options.choice.reference_px);
  write_wireframe_svg((folder / "wireframe.svg").string(), plan.wireframe, plan.motion);

  MouthAnimationSummary summary;
  for (const MouthKey& key : plan.keys) {
    summary.keys.push_back({key.frame, key.time_s, key.viseme});
  }
  summary.frames = static_cast<int>(times_s.size());
  summary.frames_per_second = rate;
  summary.error = motion_error(plan.track, plan.rows, plan.motion);
  summary.total_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return summary;
}

}  // namespace semblance
