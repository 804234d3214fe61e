#include "sweep_reconstruct_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "scan_comparison.h"
#include "scan_picture.h"
#include "semblance/core/errors.h"
#include "semblance/geometry/cylindrical_scan.h"
#include "semblance/io/image_io.h"
#include "semblance/io/mesh_io.h"
#include "semblance/io/range_map_io.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct ScanChoice {
  ScanOptions options;
  double unit_m = 1.0;
  std::vector<double> axis_point, up{0, 1, 0}, front{0, 0, 1};
};

enum class Method { null, one_sided, averaged, fitted, full };

struct ReconstructChoice {
  std::string input, output, picture;
  ScanChoice scan;
  Method method = Method::full;
  SweepForm form = SweepForm::single_scaling;
  BlendShare share = BlendShare::pair;
  int every = 10;
  double n = 0.0;
  std::optional<int> budget_contours;
  int panel_columns = 32;
  bool compare = false;
  std::vector<int> compare_budgets{26, 52, 78, 103};
  RangeEncoding encoding = RangeEncoding::png16;
  double error_scale_mm = 1.0;
};

std::string extension_of(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

Mesh read_mesh(const std::string& path, double unit_m) {
  Mesh mesh;
  const std::string extension = extension_of(path);
  if (extension == ".ply") {
    mesh = read_ply(path);
  } else if (extension == ".obj") {
    mesh = read_obj(path).mesh;
  } else {
    throw InvalidInput(path +
                       ": a mesh (.obj, .ply) or the header of a range map (.json) was "
                       "expected");
  }
  mesh.positions_m *= unit_m;
  return mesh;
}

RangeMap scan(const Mesh& mesh, const ScanChoice& choice, const std::string& path) {
  const auto vector = [](const std::vector<double>& list) {
    return Eigen::Vector3d(list[0], list[1], list[2]);
  };
  ScanOptions options = choice.options;
  options.up = vector(choice.up);
  options.front = vector(choice.front);
  if (!choice.axis_point.empty()) options.axis_point_m = vector(choice.axis_point);
  try {
    return scan_cylinder(mesh, options);
  } catch (const InvalidInput& error) {
    throw InvalidInput(path + ": " + error.what());
  }
}

Eigen::Index count(const RangeMap& map, RangeSample sample) {
  return (map.samples == sample).count();
}

void run_scan(const Context& context, const std::string& input, const std::string& output,
              const ScanChoice& choice, RangeEncoding encoding) {
  const RangeMap map = scan(read_mesh(input, choice.unit_m), choice, input);
  make_folder(output);
  const std::string path = (fs::path(output) / "range_map.json").string();
  write_range_map(path, map, encoding);
  const double mean_m = mean_radius_m(map);
  fmt::print("{} rows x {} columns, {} void, mean radius {:.2f} mm at {} m per unit\n{}\n",
             map.rows(), map.columns(), count(map, RangeSample::none), 1e3 * mean_m, choice.unit_m,
             path);
  const ordered_json summary{{"rows", map.rows()},
                             {"columns", map.columns()},
                             {"void_samples", count(map, RangeSample::none)},
                             {"mean_radius_m", mean_m},
                             {"unit_m", choice.unit_m},
                             {"range_map", path}};
  write_summary(context, summary.dump(2));
}

MeasuredTangent tangent_of(Method method) {
  switch (method) {
    case Method::null:
      return MeasuredTangent::null;
    case Method::one_sided:
      return MeasuredTangent::one_sided;
    default:
      return MeasuredTangent::averaged;
  }
}

/// Numbers that one contour of the measured methods takes, in contours.
int contours_each(const ReconstructChoice& choice) {
  switch (choice.method) {
    case Method::null:
      return 1;
    case Method::one_sided:
      return 3;
    case Method::fitted:
      return choice.share == BlendShare::profile ? 3 : 2;
    default:
      return 2;
  }
}

RadialSweep make_sweep(const RangeMap& map, const ReconstructChoice& choice) {
  const auto row_count = static_cast<int>(map.rows());
  if (choice.method == Method::full) {
    const auto contours = choice.budget_contours ? static_cast<std::size_t>(*choice.budget_contours)
                                                 : rows_every(row_count, choice.every).size();
    PlacedSweepOptions options;
    options.numbers = static_cast<std::int64_t>(contours) * map.columns();
    options.panel_columns = choice.panel_columns;
    return sweep_placed(map, options);
  }
  const std::vector<int> rows =
      choice.budget_contours
          ? rows_equally(row_count, *choice.budget_contours / contours_each(choice))
          : rows_every(row_count, choice.every);
  RadialSweep sweep = sweep_measured(map, rows, tangent_of(choice.method), choice.form, choice.n);
  if (choice.method == Method::fitted) fit_blend(sweep, map, choice.share);
  return sweep;
}

/// The map with swept radii. A path that overshoots beyond the axis leaves a void sample.
RangeMap with_radii(RangeMap map, const Grid& radius_m) {
  const auto usable = radius_m > 0.0f;
  map.radius_m = usable.select(radius_m, 0.0f);
  map.samples = usable.select(map.samples, RangeSample::none);
  return map;
}

ordered_json error_json(const RadialError& error) {
  return {{"mean_m", error.mean_m},
          {"rms_m", error.rms_m},
          {"percentile95_m", error.percentile95_m},
          {"largest_m", error.largest_m}};
}

ordered_json comparison_json(const std::vector<StoredScan>& rows) {
  ordered_json list = ordered_json::array();
  for (const StoredScan& row : rows) {
    list.push_back({{"method", row.method},
                    {"budget_numbers", row.budget_numbers},
                    {"numbers", row.numbers},
                    {"contours", row.contours},
                    {"error", error_json(row.error)},
                    {"store_s", row.store_s},
                    {"restore_s", row.restore_s}});
  }
  return list;
}

void run_reconstruct(const Context& context, const ReconstructChoice& choice) {
  const bool from_map = extension_of(choice.input) == ".json";
  Mesh mesh;
  if (!from_map) mesh = read_mesh(choice.input, choice.scan.unit_m);
  RangeMap map = from_map ? read_range_map(choice.input) : scan(mesh, choice.scan, choice.input);
  fill_voids(map);
  if (from_map) mesh = mesh_from_range_map(map);

  const RadialSweep sweep = make_sweep(map, choice);
  const auto start = std::chrono::steady_clock::now();
  const Grid radii = sweep_radii(sweep);
  const double restore_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const RangeMap swept = with_radii(map, radii);
  const RadialError error = radial_error(map, radii);
  const double mean_m = mean_radius_m(map);
  std::vector<StoredScan> comparison;
  if (choice.compare) comparison = compare_stored_scans(map, mesh, choice.compare_budgets);

  make_folder(choice.output);
  const fs::path folder = choice.output;
  write_ply((folder / "reconstruction.ply").string(), mesh_from_range_map(swept));
  write_range_map((folder / "range_map.json").string(), swept, choice.encoding);
  write_image((folder / "errors.png").string(),
              error_picture(map, radii, 1e-3 * choice.error_scale_mm));
  constexpr int picture_height_px = 600;
  if (!choice.picture.empty()) {
    write_image(choice.picture, shaded_views(swept, picture_height_px));
  }

  fmt::print("scan: {} rows x {} columns, {} filled, mean radius {:.2f} mm", map.rows(),
             map.columns(), count(map, RangeSample::filled), 1e3 * mean_m);
  if (!from_map) fmt::print(" at {} m per unit", choice.scan.unit_m);
  fmt::print(
      "\nstored: {:.1f} contours in the mean, {} numbers ({:.1f} % of the map's)\n"
      "radial error: mean {:.4f} mm ({:.3f} % of the mean radius), 95 % {:.4f} mm, largest {:.3f} "
      "mm\nswept in {:.1f} ms\n",
      sweep.mean_contours(), sweep.numbers_stored,
      100.0 * static_cast<double>(sweep.numbers_stored) / static_cast<double>(map.radius_m.size()),
      1e3 * error.mean_m, 100.0 * error.mean_m / mean_m, 1e3 * error.percentile95_m,
      1e3 * error.largest_m, 1e3 * restore_s);
  const Eigen::Index lost = count(swept, RangeSample::none);
  if (lost > 0) fmt::print("{} samples came out beyond the axis and are void\n", lost);
  if (choice.compare) fmt::print("\n{}", comparison_table(comparison));
  ordered_json summary{
      {"mean_radius_m", mean_m},           {"filled_samples", count(map, RangeSample::filled)},
      {"contours", sweep.mean_contours()}, {"numbers", sweep.numbers_stored},
      {"error", error_json(error)},        {"restore_s", restore_s}};
  if (!from_map) summary["unit_m"] = choice.scan.unit_m;
  if (choice.compare) summary["comparison"] = comparison_json(comparison);
  write_summary(context, summary.dump(2));
}

void add_scan_options(CLI::App& command, ScanChoice& choice) {
  command.add_option("--unit-m", choice.unit_m, "Metres per unit of the mesh file")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.add_option("--columns", choice.options.columns, "Angles of the scan")
      ->check(CLI::Range(static_cast<int>(fewest_range_columns),
                         static_cast<int>(most_range_samples_per_side)))
      ->capture_default_str();
  command.add_option("--rows", choice.options.rows, "Heights of the scan")
      ->check(CLI::Range(static_cast<int>(fewest_range_rows),
                         static_cast<int>(most_range_samples_per_side)))
      ->capture_default_str();
  command
      .add_option("--axis-point", choice.axis_point,
                  "A point of the axis, in metres (the middle of the mesh's box)")
      ->expected(3);
  command.add_option("--up", choice.up, "Direction of the axis")
      ->expected(3)
      ->capture_default_str();
  command.add_option("--front", choice.front, "Direction of the map's middle")
      ->expected(3)
      ->capture_default_str();
}

CLI::Option* add_encoding(CLI::App& command, RangeEncoding& encoding) {
  return command.add_option("--format", encoding, "Radii of the range map as png16 or exr (png16)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, RangeEncoding>{
          {"png16", RangeEncoding::png16}, {"exr", RangeEncoding::exr}}));
}

void add_scan_command(CLI::App& sweep, Context& context) {
  struct Choice {
    std::string input, output;
    ScanChoice scan;
    RangeEncoding encoding = RangeEncoding::png16;
  };
  auto choice = std::make_shared<Choice>();
  CLI::App* command =
      sweep.add_subcommand("scan", "Range map of a mesh, as a cylindrical digitizer sees it");
  command->add_option("mesh", choice->input, "Mesh, .obj or .ply")->required();
  command->add_option("-o,--output", choice->output, "Folder for the range map")->required();
  add_scan_options(*command, choice->scan);
  add_encoding(*command, choice->encoding);
  command->callback([&context, choice] {
    context.action = [&context, choice] {
      run_scan(context, choice->input, choice->output, choice->scan, choice->encoding);
    };
  });
}

void add_method_options(CLI::App& command, ReconstructChoice& choice) {
  command
      .add_option("--method", choice.method,
                  "null, one-sided, averaged (figures 17, 19, 20 of the report), fitted (averaged "
                  "tangents, n by least squares) or full (full)")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, Method>{{"null", Method::null},
                                                                {"one-sided", Method::one_sided},
                                                                {"averaged", Method::averaged},
                                                                {"fitted", Method::fitted},
                                                                {"full", Method::full}}));
  command
      .add_option("--form", choice.form,
                  "Of the methods but full: single or double scaling (single)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, SweepForm>{
          {"single", SweepForm::single_scaling}, {"double", SweepForm::double_scaling}}));
  command
      .add_option("--fit", choice.share, "Of fitted: one n per pair of contours or profile (pair)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, BlendShare>{
          {"pair", BlendShare::pair}, {"profile", BlendShare::profile}}));
  command
      .add_option("-n,--blend", choice.n,
                  "Blending parameter n > -1 of the methods null, one-sided and averaged")
      ->capture_default_str();
  CLI::Option* every =
      command.add_option("--every", choice.every, "Store one contour in so many rows")
          ->capture_default_str();
  command
      .add_option("--budget", choice.budget_contours,
                  "Instead of --every: store at most the numbers of so many contours")
      ->excludes(every);
  command
      .add_option("--panel-columns", choice.panel_columns,
                  "Of full: columns that share the places of their contours")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
}

}  // namespace

void add_sweep_reconstruct_command(CLI::App& sweep, Context& context) {
  add_scan_command(sweep, context);
  auto choice = std::make_shared<ReconstructChoice>();
  CLI::App* command = sweep.add_subcommand(
      "reconstruct", "Store a scan as few contours and sweep it back between them");
  command->add_option("input", choice->input, "Mesh (.obj, .ply) or range map (.json)")->required();
  command->add_option("-o,--output", choice->output, "Folder for the results")->required();
  add_scan_options(*command, choice->scan);
  add_method_options(*command, *choice);
  add_encoding(*command, choice->encoding);
  command->add_option("--picture", choice->picture, "Shaded views of the result, PNG or JPEG");
  command
      ->add_option("--error-scale-mm", choice->error_scale_mm,
                   "Radial error of full colour in errors.png")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_flag("--compare", choice->compare,
                    "Table of sweeps, splines and decimated meshes at equal numbers stored");
  command
      ->add_option("--compare-budgets", choice->compare_budgets,
                   "Contours' worth of numbers for --compare")
      ->check(CLI::Range(6, static_cast<int>(most_range_samples_per_side)))
      ->capture_default_str();
  command->callback([&context, choice] {
    context.action = [&context, choice] { run_reconstruct(context, *choice); };
  });
}

}  // namespace semblance::cli
