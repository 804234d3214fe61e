// One camera from 13 views of a chessboard, detection apart: this program's solve, with covariance,
// beside OpenCV's on the same corners.
#include <benchmark/benchmark.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "cameras/survey_maker.h"
#include "semblance/cameras/board_calibration.h"
#include "semblance/cameras/sheet_pictures.h"
#include "support.h"

namespace {

using namespace semblance;

constexpr const char* kSheet = "chessboard:9x6:0.025";

/// Corners with a fifth of a pixel of noise.
std::vector<Detection> generated_views() {
  Random random(13);
  Survey survey = sheet_survey(random, Lens::brown5, 13);
  add_sightings(survey, random, 0.2);
  std::vector<Detection> views(survey.world_from_target.size());
  for (Detection& view : views) {
    view.target = parse_target(kSheet);
    view.ids = point_ids(view.target);
    view.width = survey.cameras[0].width;
    view.height = survey.cameras[0].height;
    view.points_px.resize(2, static_cast<Eigen::Index>(view.ids.size()));
  }
  for (const Sighting& seen : survey.sightings) {
    views[static_cast<std::size_t>(seen.placement)].points_px.col(seen.point) = seen.pixel_px;
  }
  return views;
}

/// The corners of OpenCV's 13 pictures, where the real data is there.
std::vector<Detection> recorded_views(benchmark::State& state) {
  const auto folder = testing::data_path("calibration/chessboard-left");
  if (!std::filesystem::exists(folder)) {
    state.SkipWithError("needs the real data (SEMBLANCE_DATA)");
    return {};
  }
  return find_sheet({folder.string()}, parse_target(kSheet), 0, silent_progress()).detections;
}

void solve_ours(benchmark::State& state, const std::vector<Detection>& views) {
  const std::vector<std::string> names(views.size(), "view");
  double rms_px = 0.0;
  for (auto _ : state) rms_px = calibrate_board(views, names, {}).adjustment.rms_all_px;
  state.counters["rms_px"] = rms_px;
}

void solve_opencv(benchmark::State& state, const std::vector<Detection>& views) {
  if (views.empty()) return;
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const Detection& view : views) {
    points.emplace_back();
    pixels.emplace_back();
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      const Eigen::Vector3f point = point_on_sheet(view.target, view.ids[k]).cast<float>();
      const Eigen::Vector2f pixel = view.points_px.col(static_cast<Eigen::Index>(k)).cast<float>();
      points.back().emplace_back(point.x(), point.y(), point.z());
      pixels.back().emplace_back(pixel.x(), pixel.y());
    }
  }
  double rms_px = 0.0;
  for (auto _ : state) {
    cv::Mat camera, lens;
    std::vector<cv::Mat> rotations, translations;
    rms_px = cv::calibrateCamera(points, pixels, {views[0].width, views[0].height}, camera, lens,
                                 rotations, translations);
  }
  state.counters["rms_px"] = rms_px;
}

void generated_ours(benchmark::State& state) { solve_ours(state, generated_views()); }
void generated_opencv(benchmark::State& state) { solve_opencv(state, generated_views()); }
void recorded_ours(benchmark::State& state) {
  if (const auto views = recorded_views(state); !views.empty()) solve_ours(state, views);
}
void recorded_opencv(benchmark::State& state) { solve_opencv(state, recorded_views(state)); }

void detect_recorded(benchmark::State& state) {
  const auto folder = testing::data_path("calibration/chessboard-left");
  std::vector<Rgb8> images;
  if (std::filesystem::exists(folder)) {
    for_each_picture({folder.string()}, 1, [&](const Picture& picture) {
      images.push_back(picture.image);
      return true;
    });
  } else {
    state.SkipWithError("needs the real data (SEMBLANCE_DATA)");
  }
  Detector detector(parse_target(kSheet));
  for (auto _ : state) {
    for (const Rgb8& image : images) benchmark::DoNotOptimize(detector.detect(image));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(images.size()));
}

BENCHMARK(generated_ours)
    ->Name("board_13_views/generated/semblance")
    ->Unit(benchmark::kMillisecond);
BENCHMARK(generated_opencv)->Name("board_13_views/generated/opencv")->Unit(benchmark::kMillisecond);
BENCHMARK(recorded_ours)->Name("board_13_views/recorded/semblance")->Unit(benchmark::kMillisecond);
BENCHMARK(recorded_opencv)->Name("board_13_views/recorded/opencv")->Unit(benchmark::kMillisecond);
BENCHMARK(detect_recorded)
    ->Name("board_13_views/recorded/detection")
    ->Unit(benchmark::kMillisecond);

}  // namespace
