// Scans from files: made from meshes, stored as contours, and swept back.
//
// Source: Moubaraki, Tanaka and Kitamura, "Evaluation of the Homotopy Sweep Technique", ATR
// TR-C-0089 (1993), section 3.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "semblance/geometry/cylindrical_scan.h"
#include "semblance/geometry/scan_storage.h"
#include "semblance/io/range_map_io.h"
#include "semblance/pipeline/scan_comparison.h"

namespace semblance {

/// How a mesh file is scanned.
struct MeshScanOptions {
  ScanOptions scan;
  double unit_m = 1.0;  // metres per unit of the file
};

/// Scans a mesh file, .obj or .ply. Throws InvalidInput that names it.
RangeMap scan_mesh_file(const std::string& path, const MeshScanOptions& options);

/// What is written of a surface that was swept back.
struct ReconstructionFiles {
  std::string folder;   // made; gets reconstruction.ply and range_map.json with its pictures
  std::string picture;  // three shaded views; empty: none
  RangeEncoding encoding = RangeEncoding::png16;
};

struct ReconstructionOptions {
  std::string input;  // a mesh, or a range map's header (.json)
  MeshScanOptions mesh;
  StorageOptions storage;
  ReconstructionFiles files;
  double error_scale_m = 1e-3;        // radial error of full colour in errors.png
  std::vector<int> compare_contours;  // budgets to compare all methods at; empty: none
};

/// A stored scan, and what came of sweeping it back.
struct SweptScan {
  std::int64_t rows = 0, columns = 0;
  double contours = 0.0;          // in the mean over the columns
  std::int64_t numbers = 0;       // RadialSweep::numbers_stored
  std::int64_t void_samples = 0;  // that came out beyond the axis
  double restore_s = 0.0;
};

struct ReconstructionSummary {
  SweptScan swept;
  std::int64_t filled_samples = 0;  // of the scan
  double mean_radius_m = 0.0;       // of its measured samples
  RadialError error;
  std::uintmax_t file_bytes = 0;  // of stored.json
  std::vector<ScanComparison> comparison;
};

/// Whether a name is that of a range map's header rather than of a mesh.
bool is_range_map(const std::string& path);

/// Stores a scan and sweeps it back. Writes stored.json (docs/formats/radial_sweep.md), the files
/// above, and errors.png into the folder. Throws InvalidInput before anything is written.
ReconstructionSummary reconstruct_scan(const ReconstructionOptions& options);

/// Sweeps back what `reconstruct_scan` stored, to the same surface bit by bit. Without the scan
/// there is no error to tell. Throws InvalidInput before anything is written.
SweptScan restore_scan(const std::string& stored_path, const ReconstructionFiles& files);

}  // namespace semblance
