// The program's commands. Each adds itself to the parser and leaves what to run in `action`.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

namespace semblance::cli {

/// What all commands share.
struct Context {
  std::string json_path;         // --json: summary figures as one JSON object
  std::function<void()> action;  // set by the command that was chosen
};

void add_track_commands(CLI::App& app, Context& context);
void add_sweep_commands(CLI::App& app, Context& context);
void add_sweep_surface_command(CLI::App& sweep, Context& context);
void add_sweep_blends_command(CLI::App& sweep, Context& context);
void add_sweep_animate_command(CLI::App& sweep, Context& context);
void add_sweep_scan_command(CLI::App& sweep, Context& context);
void add_sweep_reconstruct_command(CLI::App& sweep, Context& context);
void add_synth_commands(CLI::App& app, Context& context);
void add_calibrate_commands(CLI::App& app, Context& context);
void add_demo_command(CLI::App& app, Context& context);
void add_compare_command(CLI::App& app, Context& context);
void add_simulate_command(CLI::App& app, Context& context);
void add_fabric_commands(CLI::App& app, Context& context);
void add_calibrate_convert_command(CLI::App& calibrate, Context& context);
void add_calibrate_board_command(CLI::App& calibrate, Context& context);
void add_calibrate_rig_command(CLI::App& calibrate, Context& context);
void add_calibrate_photos_command(CLI::App& calibrate, Context& context);
void add_calibrate_judge_command(CLI::App& calibrate, Context& context);
void add_calibrate_markers_command(CLI::App& calibrate, Context& context);

void add_calibrate_object_command(CLI::App& calibrate, Context& context);

/// A wrong name of a calibration sheet is wrong usage.
CLI::Validator sheet_name();

/// Creates a folder and those above it; throws IoError where that is refused.
void make_folder(const std::string& folder);

/// Writes the summary where --json asked for it.
void write_summary(const Context& context, const std::string& json);

}  // namespace semblance::cli
