// What an animated mouth leaves for other programs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mouth_painter.h"
#include "semblance/io/lip_markers.h"
#include "semblance/io/video.h"
#include "semblance/models/mouth_keys.h"
#include "semblance/models/mouth_wireframe.h"

namespace semblance {

/// The motion's markers at the times as a track: numbered from 0, `bridged` between key frames and
/// as in the track on them, with the lower confidence of the key frames on both sides.
LipTrack animated_track(const LipTrack& source, const std::vector<int>& key_rows,
                        const MouthMotion& motion, const std::vector<double>& times_s);

/// docs/formats/mouth-wireframe.md.
void write_wireframe_json(const std::string& path, const MouthWireframe& wireframe,
                          const MouthMotion& motion, const std::vector<MouthKey>& keys,
                          const std::vector<double>& times_s);

/// The lips as binary glTF, in metres, with the origin in the middle of the first frame's and times
/// from 0: a morph target for each of at most 500 evenly spaced times, shown one after the other.
/// `texture` is the picture, seen by the camera of `space`, at the first time.
void write_mouth_glb(const std::string& path, const MouthWireframe& wireframe,
                     const MouthMotion& motion, const std::vector<double>& times_s,
                     const PictureSpace& space, const std::optional<Rgb8>& texture);

}  // namespace semblance
