// A mouth animated from key frames, on one core: positions of the whole wireframe of 16 markers
// (160 points) at a time, and the choice of key frames.
#include <benchmark/benchmark.h>

#include "semblance/models/mouth_keys.h"
#include "semblance/models/mouth_wireframe.h"
#include "talking_mouth.h"

namespace semblance {
namespace {

void mouth_wireframe(benchmark::State& state) {
  const LipTrack track = testing::TalkingMouth{}.track(60, 25.0);
  std::vector<MouthKey> keys;
  for (const int row : {0, 12, 30, 59}) keys.push_back(make_key(track, row, 2));
  const MouthMotion motion(keys);
  MouthPoints markers, points;
  motion.at(0.0, markers);
  const MouthWireframe wireframe(markers);
  double time_s = 0.0;
  for (auto _ : state) {
    motion.at(time_s, markers);
    wireframe.evaluate(markers, points);
    benchmark::DoNotOptimize(points.data());
    time_s = time_s < motion.end_s() ? time_s + 0.001 : 0.0;
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(mouth_wireframe)->Name("mouth_wireframe/16");

/// Tracks of as many frames, down to 1 pixel.
void mouth_keys(benchmark::State& state) {
  const LipTrack track = testing::TalkingMouth{}.track(static_cast<int>(state.range(0)), 25.0);
  for (auto _ : state) benchmark::DoNotOptimize(choose_keys(track, {}));
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(mouth_keys)->Name("mouth_keys")->Arg(150)->Arg(1500)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace semblance
