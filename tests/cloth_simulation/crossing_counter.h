// Looks for penetrations while a simulation runs.
#pragma once

#include "semblance/cloth/simulation.h"

namespace semblance::testing {

/// Counts what has passed through what at every frame.
struct CrossingCounter : SimulationSink {
  explicit CrossingCounter(const ClothScene& scene) : system(scene) {}
  void frame(int, double time_s, const Sheet&, const Points& positions_m) override {
    system.contacts().update(positions_m, time_s);
    crossings += static_cast<int>(system.contacts().penetrations(positions_m).size());
    ++frames;
  }
  ClothSystem system;
  int frames = 0, crossings = 0;
};

}  // namespace semblance::testing
