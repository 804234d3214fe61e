// What the tracker believes, drawn over what the camera saw.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "semblance/core/camera.h"
#include "semblance/core/scene.h"
#include "semblance/io/track_file.h"
#include "semblance/io/video.h"

namespace semblance {

/// Whole number by which overlays enlarge a source of this width: 1 from 640 pixels on, else the
/// smallest that reaches 640, so that text and lines can be read.
int overlay_scale(int source_width);

/// Size of text and marks in a picture of this width, relative to one of 800 pixels.
double overlay_unit(int picture_width);

/// What every overlay shows of a frame, painted over the picture: a banner with state, number, time
/// and `figures`. A lost frame is grey in a red border, and has no figures.
void paint_status(Rgb8& picture, const TrackFrame& track, const std::string& figures);

/// Paints overlays of one camera: a thinned wire of the visible surface, landmarks, the head's axes
/// (x red to its left, y green up, z blue out of the nose, 2.5, 2.5 and 8 cm) and a banner with the
/// state. A lost frame is grey in a red border and shows no estimate. Keeps the thinned wire of
/// each mesh it has seen, so one painter per thread.
class OverlayPainter {
 public:
  explicit OverlayPainter(const Camera& camera);
  ~OverlayPainter();
  OverlayPainter(OverlayPainter&&) noexcept;

  /// Size of the pictures: the camera's, enlarged by overlay_scale.
  int width() const;
  int height() const;

  /// `scene` holds the posed model (ignored for a lost frame). Throws InvalidInput unless `source`
  /// has the camera's size.
  Rgb8 paint(const Rgb8& source, const Scene& scene, const TrackFrame& track);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Paints and encodes a video on a thread of its own, in the order of `write`; at most eight frames
/// wait. An error on that thread is rethrown by the next `write` or `close`.
class OverlayWriter {
 public:
  /// `painted`, where given, sees every picture before it is encoded, on the writer's thread.
  using Painted = std::function<void(const Rgb8& picture, const TrackFrame& track)>;

  OverlayWriter(const std::string& path, const Camera& camera, double frames_per_second,
                Painted painted = {});
  ~OverlayWriter();  // without close(): nothing is left under `path`
  OverlayWriter(OverlayWriter&&) noexcept;

  /// Copies what it needs of `scene`.
  void write(Rgb8 source, const Scene& scene, TrackFrame track);
  /// Waits for the last frame and gives the file its name.
  void close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
