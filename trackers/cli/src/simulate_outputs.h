// Files of a simulation.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "semblance/cloth/simulation.h"

namespace semblance::cli {

/// Where a run leaves what it makes. Every file appears whole under its name. The folder is made,
/// and the files of an earlier run are removed from it, only once a new run has proved possible.
class SimulationFiles : public SimulationSink {
 public:
  /// `format` of frames: "obj", "ply", "glb" or "none". `resume`: keep what is there.
  SimulationFiles(std::string folder, std::string format, bool resume);

  /// There is nothing to resume after all.
  void start_anew() { resume_ = false; }

  void begin() override;
  void frame(int number, double time_s, const Sheet& sheet, const Points& positions_m) override;
  void level_done(int number, const SimulationLevel& level, const Sheet& sheet,
                  const Points& positions_m) override;
  void checkpoint(const SimulationCheckpoint& checkpoint) override;
  void warn(const std::string& message) override;

  /// Everything that is written at the end. A run that was stopped keeps its checkpoint and gets
  /// its log alone.
  void finish(const SimulationSummary& summary, double frames_per_second);
  std::string checkpoint_path() const { return path("checkpoint.bin"); }

 private:
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::string frame_path(int number) const;
  void write_shape(const std::string& name, const Sheet& sheet, const Points& positions_m) const;
  void write_state(const SimulationSummary& summary) const;
  void write_log(const SimulationSummary& summary) const;
  void write_strain(const SimulationSummary& summary) const;
  void write_profile(const DrapeProfile& profile) const;
  void write_animation(const SimulationSummary& summary, double frames_per_second) const;

  std::filesystem::path folder_;
  std::string format_;
  bool resume_ = false;
};

/// The figures of a run, as --json has them.
nlohmann::json simulation_json(const SimulationSummary& summary, const std::string& method,
                               double spacing_m);

}  // namespace semblance::cli
