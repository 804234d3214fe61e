#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "scan_options.h"
#include "semblance/core/atomic_file.h"

namespace semblance::cli {

namespace {

struct ScanArguments {
  std::string input, folder;
  MeshScanOptions options;
  RangeEncoding encoding = RangeEncoding::png16;
};

void run_scan(const Context& context, const ScanArguments& arguments) {
  const RangeMap map = scan_mesh_file(arguments.input, arguments.options);
  prepare_output_folder(arguments.folder);
  const std::string path = (std::filesystem::path(arguments.folder) / "range_map.json").string();
  write_range_map(path, map, arguments.encoding);
  const double mean_m = mean_radius_m(map);
  const auto voids = (map.samples == RangeSample::none).count();
  fmt::print("{} rows x {} columns, {} void, mean radius {:.2f} mm at {} m per unit\n{}\n",
             map.rows(), map.columns(), voids, 1e3 * mean_m, arguments.options.unit_m, path);
  const nlohmann::ordered_json summary{
      {"rows", map.rows()},      {"columns", map.columns()},           {"void_samples", voids},
      {"mean_radius_m", mean_m}, {"unit_m", arguments.options.unit_m}, {"range_map", path}};
  write_summary(context, summary.dump(2));
}

/// An option of three numbers.
CLI::Option* add_vector(CLI::App& command, const std::string& name, Eigen::Vector3d& value,
                        const std::string& help) {
  const auto set = [&value](const std::vector<double>& list) {
    value = Eigen::Vector3d(list[0], list[1], list[2]);
  };
  return command.add_option_function<std::vector<double>>(name, set, help)->expected(3);
}

}  // namespace

void add_scan_options(CLI::App& command, MeshScanOptions& options) {
  ScanOptions& scan = options.scan;
  constexpr int most = static_cast<int>(most_range_samples_per_side);
  command.add_option("--unit-m", options.unit_m, "Metres per unit of the mesh file")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.add_option("--columns", scan.columns, "Angles of the scan")
      ->check(CLI::Range(static_cast<int>(fewest_range_columns), most))
      ->capture_default_str();
  command.add_option("--rows", scan.rows, "Heights of the scan")
      ->check(CLI::Range(static_cast<int>(fewest_range_rows), most))
      ->capture_default_str();
  const auto set_axis = [&scan](const std::vector<double>& list) {
    scan.axis_point_m = Eigen::Vector3d(list[0], list[1], list[2]);
  };
  command
      .add_option_function<std::vector<double>>(
          "--axis-point", set_axis, "A point of the axis, in metres (the middle of the mesh's box)")
      ->expected(3);
  add_vector(command, "--up", scan.up, "Direction of the axis (0 1 0)");
  add_vector(command, "--front", scan.front, "Direction of the map's middle (0 0 1)");
}

void add_encoding_option(CLI::App& command, RangeEncoding& encoding) {
  command.add_option("--format", encoding, "Radii of the range map as png16 or exr (png16)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, RangeEncoding>{
          {"png16", RangeEncoding::png16}, {"exr", RangeEncoding::exr}}));
}

void add_sweep_scan_command(CLI::App& sweep, Context& context) {
  auto arguments = std::make_shared<ScanArguments>();
  CLI::App* command =
      sweep.add_subcommand("scan", "Range map of a mesh, as a cylindrical digitizer sees it");
  command->add_option("mesh", arguments->input, "Mesh, .obj or .ply")->required();
  command->add_option("-o,--output", arguments->folder, "Folder for the range map")->required();
  add_scan_options(*command, arguments->options);
  add_encoding_option(*command, arguments->encoding);
  command->callback([&context, arguments] {
    context.action = [&context, arguments] { run_scan(context, *arguments); };
  });
}

}  // namespace semblance::cli
