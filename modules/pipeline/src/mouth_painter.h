// Pictures of a moving mouth.
#pragma once

#include <memory>

#include "mouth_sheet.h"
#include "semblance/core/camera.h"
#include "semblance/core/scene.h"
#include "semblance/render/renderer.h"

namespace semblance {

/// Mouth points in space: a camera that looks along -z from the world's origin sees each of them at
/// its pixel, at the depth it has. The focal length is 1.05 times the picture's longer side, and
/// the mouth of `width_px` is 51 mm wide, an adult's average.
class PictureSpace {
 public:
  PictureSpace(int width, int height, double mouth_width_px);
  const Camera& camera() const { return camera_; }
  PointsF world_m(const MouthPoints& points_px) const;

 private:
  Camera camera_;
  double metre_per_px_;
};

/// Warps one picture, in which the markers are known, to where the markers are at other times. The
/// inside of the mouth is the picture's as far as its mouth is open, and dark where it has to be
/// opened further. Not for several threads at once.
class MouthPainter {
 public:
  /// `picture`: linear RGB.
  MouthPainter(const MouthWireframe& wireframe, const MouthPoints& markers, Image picture);
  /// Without a picture: plain skin, shaded lips and a dark inside.
  MouthPainter(const MouthWireframe& wireframe, const MouthPoints& markers, int width, int height);

  /// The whole picture; far from the mouth it is the given one.
  Image paint(const MouthPoints& markers);

 private:
  void add_object(const char* name, int first_triangle, int triangle_count,
                  const Material& material);
  void pose();
  double cavity_darkness() const;

  MouthWireframe wireframe_;
  MouthSheet sheet_;
  PictureSpace space_;
  std::shared_ptr<const Image> background_;
  bool textured_;
  Scene scene_;
  std::unique_ptr<Renderer> renderer_;
  MouthPoints points_px_;  // of the sheet
};

/// Mean height of the opening: the area inside C3 over the distance of the outer corners.
double mouth_opening_px(const MouthWireframe& wireframe, const MouthPoints& points_px);

}  // namespace semblance
