// What the commands that look at a sheet have in common.
#pragma once

#include <string>
#include <vector>

#include "commands.h"
#include "semblance/cameras/rig_calibration.h"
#include "semblance/cameras/sheet_pictures.h"
#include "semblance/core/lens.h"
#include "semblance/core/progress.h"

namespace semblance::cli {

struct SheetOptions {
  std::vector<std::string> files;
  std::vector<std::string> distances;  // as in "left:right:0.3"
  std::string target, lens = "brown5", folder;
  int most_frames = 200;
  bool square_pixels = false, centred = false, warp = false, keep_outliers = false;
};

void add_sheet_options(CLI::App& command, SheetOptions& options);

/// What BoardOptions and RigOptions have in common.
template <class Options>
Options solver_options(const SheetOptions& options) {
  Options result;
  result.lens = *lens_from_name(options.lens);
  result.aspect = !options.square_pixels;
  result.principal = !options.centred;
  result.warp = options.warp;
  result.keep_outliers = options.keep_outliers;
  result.cancelled = [] { return interrupted(); };
  return result;
}

/// What the detection warned of, each text once.
void add_notes(const SheetPictures& pictures, std::vector<std::string>& notes);

/// A sheet whose size no one told: the shape of the result is right, its scale is not.
void note_size(const Target& asked, std::vector<std::string>& notes);

/// The sheet's size gives the scale; lengths measured by hand tell whether it is right. Throws
/// InvalidInput for ends that are neither points of the sheet nor among the cameras.
void check_distances(const SheetOptions& options, const Target& target,
                     const std::vector<Camera>& cameras, std::vector<std::string>& notes);

/// Names of cameras: as given, or from those of their files. Throws InvalidInput where two are
/// alike.
std::vector<std::string> camera_names(const std::vector<std::string>& files,
                                      const std::vector<std::string>& given = {});

/// The cameras of several files, in any format of `convert`. Throws InvalidInput where two have the
/// same name.
std::vector<Camera> given_cameras(const std::vector<std::string>& files);

/// The first picture of a file or folder.
Rgb8 first_picture(const std::string& file);

/// The pictures that show the sheet, one entry of the list per camera.
std::vector<RigView> rig_views(const std::vector<SheetPictures>& pictures, bool with_velocities);

}  // namespace semblance::cli
