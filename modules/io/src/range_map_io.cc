#include "semblance/io/range_map_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "opencv_image.h"
#include "range_map_header.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;

constexpr float steps = 65535.0f;
// Grey levels of the marks, far enough apart to be seen.
constexpr std::uint8_t void_level = 0, filled_level = 128, measured_level = 255;

/// OpenCV reads and writes OpenEXR only where the environment says so when it is first asked.
void allow_exr() {
  static std::once_flag once;
  std::call_once(once, [] { setenv("OPENCV_IO_ENABLE_OPENEXR", "1", /*overwrite=*/1); });
}

/// A picture of one channel and the given type and size.
cv::Mat read_picture(const fs::path& path, int type, const RangeMapHeader& header,
                     const char* kind) {
  allow_exr();
  silence_opencv();
  std::error_code error;
  if (!fs::exists(path, error)) {
    throw IoError(path.string() + ": cannot be opened: no such file; keep it beside its header");
  }
  cv::Mat picture;
  try {
    picture = cv::imread(path.string(), cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    // Reported below like every other picture that cannot be decoded.
  }
  if (picture.empty() || picture.type() != type) {
    throw InvalidInput(fmt::format("{}: is not {}, as its header says", path.string(), kind));
  }
  if (picture.rows != header.rows || picture.cols != header.columns) {
    throw InvalidInput(
        fmt::format("{}: has {} x {} pixels, but its header says {} columns and {} rows; take both "
                    "from the same scan",
                    path.string(), picture.cols, picture.rows, header.columns, header.rows));
  }
  return picture;
}

RangeSample sample_of(std::uint8_t level, const fs::path& path) {
  switch (level) {
    case void_level:
      return RangeSample::none;
    case filled_level:
      return RangeSample::filled;
    case measured_level:
      return RangeSample::measured;
    default:
      throw InvalidInput(
          fmt::format("{}: has a pixel of {}; {} (void), {} (filled) or {} "
                      "(measured) was expected",
                      path.string(), level, void_level, filled_level, measured_level));
  }
}

std::uint8_t level_of(RangeSample sample) {
  if (sample == RangeSample::measured) return measured_level;
  return sample == RangeSample::filled ? filled_level : void_level;
}

/// The picture's row of a map's row: pictures start at the top.
int picture_row(const RangeMap& map, Eigen::Index row) {
  return static_cast<int>(map.rows() - 1 - row);
}

/// Where a sample is void the radius has no meaning.
float largest_radius_m(const RangeMap& map) {
  return (map.samples == RangeSample::none).select(0.0f, map.radius_m).maxCoeff();
}

cv::Mat radius_picture(const RangeMap& map, const RangeMapHeader& header) {
  const bool exr = header.encoding == RangeEncoding::exr;
  cv::Mat picture(header.rows, header.columns, exr ? CV_32FC1 : CV_16UC1);
  for (Eigen::Index row = 0; row < map.rows(); ++row) {
    for (int column = 0; column < header.columns; ++column) {
      const float radius =
          map.samples(row, column) == RangeSample::none ? 0.0f : map.radius_m(row, column);
      if (exr) {
        picture.at<float>(picture_row(map, row), column) = radius;
      } else {
        // A radius that is there never rounds to none.
        const auto level = std::lround(radius / header.radius_step_m);
        picture.at<std::uint16_t>(picture_row(map, row), column) =
            static_cast<std::uint16_t>(radius > 0.0f ? std::max(level, 1L) : 0L);
      }
    }
  }
  return picture;
}

cv::Mat samples_picture(const RangeMap& map) {
  cv::Mat picture(static_cast<int>(map.rows()), static_cast<int>(map.columns()), CV_8UC1);
  for (Eigen::Index row = 0; row < map.rows(); ++row) {
    for (Eigen::Index column = 0; column < map.columns(); ++column) {
      picture.at<std::uint8_t>(picture_row(map, row), static_cast<int>(column)) =
          level_of(map.samples(row, column));
    }
  }
  return picture;
}

void encode(const cv::Mat& picture, const fs::path& path, AtomicFile& file) {
  std::vector<std::uint8_t> bytes;
  bool done = false;
  try {
    done = cv::imencode(path.extension().string(), picture, bytes);
  } catch (const cv::Exception&) {
    // Reported below.
  }
  if (!done) throw IoError(path.string() + ": the image encoder failed");
  file.stream().write(reinterpret_cast<const char*>(bytes.data()),
                      static_cast<std::streamsize>(bytes.size()));
}

}  // namespace

RangeMap read_range_map(const std::string& header_path) {
  constexpr std::uintmax_t largest_header = 1 << 20;
  const RangeMapHeader header =
      parse_range_map_header(text::read_file(header_path, largest_header), header_path);
  const fs::path folder = fs::path(header_path).parent_path();
  const bool exr = header.encoding == RangeEncoding::exr;
  const cv::Mat radii =
      read_picture(folder / header.radius_file, exr ? CV_32FC1 : CV_16UC1, header,
                   exr ? "an OpenEXR picture of one float channel" : "a grey PNG of 16 bits");
  const fs::path samples_path = folder / header.samples_file;
  const cv::Mat marks = read_picture(samples_path, CV_8UC1, header, "a grey PNG of 8 bits");
  RangeMap map;
  map.bottom_m = header.bottom_m;
  map.spacing_m = header.spacing_m;
  map.world_from_map = header.world_from_map;
  map.radius_m.resize(header.rows, header.columns);
  map.samples.resize(header.rows, header.columns);
  for (int row = 0; row < header.rows; ++row) {
    const int line = picture_row(map, row);
    for (int column = 0; column < header.columns; ++column) {
      map.samples(row, column) = sample_of(marks.at<std::uint8_t>(line, column), samples_path);
      const double radius_m = exr ? radii.at<float>(line, column)
                                  : radii.at<std::uint16_t>(line, column) * header.radius_step_m;
      const bool seen = map.samples(row, column) != RangeSample::none;
      map.radius_m(row, column) = seen ? static_cast<float>(radius_m) : 0.0f;
    }
  }
  validate(map, header_path);
  return map;
}

void write_range_map(const std::string& header_path, const RangeMap& map, RangeEncoding encoding) {
  validate(map, header_path);
  if (text::lower_extension(header_path) != ".json") {
    throw InvalidInput(header_path + ": the header of a range map is named .json");
  }
  allow_exr();
  silence_opencv();
  const std::string name = fs::path(header_path).stem().string();
  RangeMapHeader header{static_cast<int>(map.rows()),
                        static_cast<int>(map.columns()),
                        map.bottom_m,
                        map.spacing_m,
                        largest_radius_m(map) / steps,
                        map.world_from_map,
                        encoding,
                        name + (encoding == RangeEncoding::exr ? ".exr" : ".png"),
                        name + "_samples.png"};
  const fs::path folder = fs::path(header_path).parent_path();
  const fs::path radius_path = folder / header.radius_file,
                 samples_path = folder / header.samples_file;
  AtomicFile radius_file(radius_path), samples_file(samples_path), header_file(header_path);
  encode(radius_picture(map, header), radius_path, radius_file);
  encode(samples_picture(map), samples_path, samples_file);
  header_file.stream() << format_range_map_header(header);
  radius_file.commit();
  samples_file.commit();
  header_file.commit();
}

}  // namespace semblance
