#include "semblance/pipeline/scan_reconstruction.h"

#include <chrono>
#include <filesystem>

#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/image_io.h"
#include "semblance/io/mesh_io.h"
#include "semblance/io/radial_sweep_io.h"
#include "semblance/pipeline/scan_picture.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;

/// What would otherwise fail after the work.
void check(const ReconstructionFiles& files) {
  if (!files.picture.empty()) require_image_name(files.picture);
}

/// What was scanned, and the map with its voids filled.
struct Scan {
  Mesh mesh;
  RangeMap map;
};

RangeMap scan(const Mesh& mesh, const ScanOptions& options, const std::string& path) {
  try {
    return scan_cylinder(mesh, options);
  } catch (const InvalidInput& error) {
    throw InvalidInput(path + ": " + error.what());
  }
}

Mesh read_scaled_mesh(const std::string& path, double unit_m) {
  Mesh mesh = read_mesh(path);
  mesh.positions_m *= unit_m;
  return mesh;
}

Scan load_scan(const std::string& path, const MeshScanOptions& options) {
  Scan result;
  if (is_range_map(path)) {
    result.map = read_range_map(path);
    fill_voids(result.map);
    result.mesh = mesh_from_range_map(result.map);
  } else {
    result.mesh = read_scaled_mesh(path, options.unit_m);
    result.map = scan(result.mesh, options.scan, path);
    fill_voids(result.map);
  }
  return result;
}

RangeMap sweep_back(const RadialSweep& sweep, SweptScan& summary) {
  const auto start = std::chrono::steady_clock::now();
  RangeMap swept = swept_map(sweep);
  summary.restore_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  summary.rows = swept.rows();
  summary.columns = swept.columns();
  summary.contours = sweep.mean_contours();
  summary.numbers = sweep.numbers_stored;
  summary.void_samples = (swept.samples == RangeSample::none).count();
  return swept;
}

void write_swept(const RangeMap& swept, const ReconstructionFiles& files) {
  constexpr int picture_height_px = 600;
  const fs::path folder = files.folder;
  write_ply((folder / "reconstruction.ply").string(), mesh_from_range_map(swept));
  write_range_map((folder / "range_map.json").string(), swept, files.encoding);
  if (!files.picture.empty()) write_image(files.picture, shaded_views(swept, picture_height_px));
}

}  // namespace

bool is_range_map(const std::string& path) { return fs::path(path).extension() == ".json"; }

RangeMap scan_mesh_file(const std::string& path, const MeshScanOptions& options) {
  return scan(read_scaled_mesh(path, options.unit_m), options.scan, path);
}

ReconstructionSummary reconstruct_scan(const ReconstructionOptions& options) {
  check(options.files);
  const Scan scan = load_scan(options.input, options.mesh);
  const RadialSweep sweep = store_scan(scan.map, options.storage);
  ReconstructionSummary summary;
  const RangeMap swept = sweep_back(sweep, summary.swept);
  validate(swept, options.input);
  // Not of `swept`, which has no radius where a path overshoots.
  const Grid radii = sweep_radii(sweep);
  summary.filled_samples = (scan.map.samples == RangeSample::filled).count();
  summary.mean_radius_m = mean_radius_m(scan.map);
  summary.error = radial_error(scan.map, radii);
  summary.comparison = compare_stored_scans(scan.map, scan.mesh, options.compare_contours);

  prepare_output_folder(options.files.folder);
  const fs::path folder = options.files.folder, stored = folder / "stored.json";
  write_radial_sweep(stored.string(), sweep);
  summary.file_bytes = fs::file_size(stored);
  write_swept(swept, options.files);
  write_image((folder / "errors.png").string(),
              error_picture(scan.map, radii, options.error_scale_m));
  return summary;
}

SweptScan restore_scan(const std::string& stored_path, const ReconstructionFiles& files) {
  check(files);
  SweptScan summary;
  const RangeMap swept = sweep_back(read_radial_sweep(stored_path), summary);
  validate(swept, stored_path);
  prepare_output_folder(files.folder);
  write_swept(swept, files);
  return summary;
}

}  // namespace semblance
