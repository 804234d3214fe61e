// One frame of the lip tracker, all 16 markers seen, without decoding: the mouth is 130 pixels
// wide.
#include <benchmark/benchmark.h>

#include <opencv2/core.hpp>

#include "painted_mouth.h"
#include "semblance/lips/lip_tracker.h"

namespace semblance {
namespace {

constexpr int kFrames = 12;

std::vector<Image> clip() {
  std::vector<Image> pictures;
  for (int t = 0; t < kFrames; ++t) {
    const auto shape = testing::mouth_shape(0.5 + 0.5 * std::sin(0.5 * t));
    const auto places = testing::place_mouth(shape, {320.0 + 2 * t, 300.0 - t}, 65, 0.01 * t);
    pictures.push_back(testing::paint_dots(640, 480, places, {}, 1 + t));
  }
  return pictures;
}

void track_lip_markers(benchmark::State& state) {
  cv::setNumThreads(1);
  const std::vector<Image> pictures = clip();
  LipTracker tracker(16);
  tracker.follow(0, 0.0, pictures[0]);
  int frame = 1;
  int seen = 0;
  for (auto _ : state) {
    // Forwards and backwards, so that the mouth does not jump.
    const int turn = frame % (2 * kFrames - 2);
    const int index = turn < kFrames ? turn : 2 * kFrames - 2 - turn;
    const LipEstimate found = tracker.follow(frame++, 0.0, pictures[index]);
    for (const TrackedMarker& m : found.markers) seen += m.known() ? 1 : 0;
  }
  if (seen != 16 * (frame - 1)) state.SkipWithError("not all markers were seen");
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(track_lip_markers)->Name("lip_markers/640x480")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace semblance
