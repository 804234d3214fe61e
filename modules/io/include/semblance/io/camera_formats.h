// Camera files of other programs. What each holds, its conventions and where they are stated:
// docs/formats/cameras-elsewhere.md.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "semblance/io/camera_rig.h"
#include "semblance/io/colmap.h"

namespace semblance {

/// What a file holds, in this program's conventions. The world is the file's own: its axes are not
/// turned.
struct CameraFile {
  CameraRig rig;
  std::optional<ColmapModel>
      model{};                       // with the observations and points, where it came from COLMAP
  std::vector<std::string> notes{};  // what was assumed or is not kept, for people
};

/// A format. To add one: a source file that defines it, a line in the table of camera_formats.cc.
struct CameraFormat {
  std::string_view name;     // "kalibr"
  std::string_view title;    // "Kalibr camchain"
  bool has_unit = true;      // false: lengths are in a unit that the file does not say
  bool keeps_model = false;  // COLMAP's observations and points
  /// Whether a file of this content (a folder: empty), at this path, is of the format.
  bool (*recognises)(const std::string& path, std::string_view content) = nullptr;
  /// Whether a file to be written at this path is meant to be of the format.
  bool (*suits)(const std::string& path) = nullptr;
  /// Throws InvalidInput that names the file, the place and what to do.
  CameraFile (*read)(const std::string& path) = nullptr;
  /// Gives notes on what the format does not hold. Throws InvalidInput for a lens it cannot hold.
  std::vector<std::string> (*write)(const std::string& path, const CameraFile& file) = nullptr;
};

const std::vector<const CameraFormat*>& camera_formats();
/// Null where there is no format of the name.
const CameraFormat* find_camera_format(std::string_view name);
/// The format of a file or folder by its content; InvalidInput that lists the formats if none.
const CameraFormat& recognise_camera_file(const std::string& path);
/// The format that a file of this name should have; InvalidInput that lists the formats if none.
const CameraFormat& format_for_writing(const std::string& path);

/// Reads, checks, and takes one unit of length of the file for `metres_per_unit`.
CameraFile read_cameras(const std::string& path, const CameraFormat& format,
                        double metres_per_unit = 1.0);
/// Writes what was read, or a rig from elsewhere; gives notes as the format does.
std::vector<std::string> write_cameras(const std::string& path, const CameraFile& file,
                                       const CameraFormat& format);

}  // namespace semblance
