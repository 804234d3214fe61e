// The `semblance` program. Exit codes: 0 done (also tracking that was stopped on request, whose
// results so far are valid), 2 wrong usage, 3 bad input, 4 nothing converged.
#include <fmt/format.h>

#include <exception>
#include <filesystem>

#include "commands.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/core/progress.h"
#include "semblance/core/version.h"

namespace semblance::cli {

void make_folder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw IoError(folder + ": cannot be used as the output folder (" + error.message() +
                  "); name a folder in a place you can write to");
  }
}

void write_summary(const Context& context, const std::string& json) {
  if (context.json_path.empty()) return;
  AtomicFile file(context.json_path);
  file.stream() << json << '\n';
  file.commit();
}

}  // namespace semblance::cli

namespace {

enum ExitCode { done = 0, wrong_usage = 2, bad_input = 3, not_converged = 4 };

int fail(const char* what, int code) {
  fmt::print(stderr, "semblance: {}\n", what);
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace semblance;
  CLI::App app("Analysis by synthesis: tracks faces in video, with uncertainty, on the CPU.",
               "semblance");
  app.set_version_flag("--version", program_version());
  app.require_subcommand(1);
  app.fallthrough();
  app.set_config("--config", "", "Read options from a TOML file; unknown keys are errors");
  app.allow_config_extras(CLI::config_extras_mode::error);
  cli::Context context;
  int threads = 0;
  app.add_option("--json", context.json_path, "Write the summary figures to this file as JSON");
  app.add_option("--threads", threads, "Threads to use (0: one per core)")
      ->check(CLI::Range(0, 1024));
  cli::add_track_commands(app, context);
  cli::add_sweep_commands(app, context);
  cli::add_synth_commands(app, context);
  cli::add_calibrate_commands(app, context);
  cli::add_demo_command(app, context);
  cli::add_compare_command(app, context);
  cli::add_simulate_command(app, context);
  cli::add_fabric_commands(app, context);
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::CallForAllHelp& help) {
    return app.exit(help);
  } catch (const CLI::CallForVersion& version) {
    return app.exit(version);
  } catch (const CLI::ParseError& error) {
    app.exit(error);
    return wrong_usage;
  }
  try {
    catch_interrupts();
    set_thread_count(threads);
    context.action();
    return done;
  } catch (const SolverError& error) {
    return fail(error.what(), not_converged);
  } catch (const std::exception& error) {
    return fail(error.what(), bad_input);
  }
}
