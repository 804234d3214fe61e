#include "commands.h"

namespace semblance::cli {

void add_sweep_commands(CLI::App& app, Context& context) {
  CLI::App* sweep =
      app.add_subcommand("sweep", "Homotopy sweeps: surfaces, scans, and mouths in motion");
  sweep->require_subcommand(1);
  add_sweep_surface_command(*sweep, context);
  add_sweep_blends_command(*sweep, context);
  add_sweep_animate_command(*sweep, context);
  add_sweep_scan_command(*sweep, context);
  add_sweep_reconstruct_command(*sweep, context);
}

}  // namespace semblance::cli
