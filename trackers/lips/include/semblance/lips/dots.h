// Round dots of one paint in a picture: finding them, and measuring where one lies.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "semblance/core/image.h"

namespace semblance {

/// A rectangle of pixels: [x0, x0 + width) x [y0, y0 + height).
struct PixelRect {
  int x0 = 0, y0 = 0, width = 0, height = 0;
};

/// One channel over a part of a picture; the place p of the picture is p - (x0, y0) in `image`.
struct Patch {
  PixelRect rect;
  Image image;
};

/// A spot that differs from what surrounds it. Colours are square roots of linear RGB
/// (encode_intensity): noise is about even on that scale.
struct Spot {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  // to about a pixel
  double radius_px = 0.0;                               // to about a fifth
  Eigen::Vector3f contrast = Eigen::Vector3f::Zero();   // colour inside minus colour around
};

/// Spots of any colour and size (radius from 1.5 pixels to a 25th of the width), strongest first,
/// at most `most`. Extrema over place and scale of differences of Gaussians (Lindeberg 1998,
/// "Feature detection with automatic scale selection"), taken as the length of the colour
/// difference, so that no colour or polarity is preferred. Elongated spots are left out.
std::vector<Spot> find_spots(const Image& linear_rgb, int most);

/// How the dots look, relative to what is around them: `weights` maps a colour to a value that is
/// about 1 + background in a dot, with as little variation beside the dots as a linear map allows
/// (Fisher 1936, "The use of multiple measurements in taxonomic problems").
struct DotLook {
  Eigen::Vector3f weights = Eigen::Vector3f::Zero();
  double radius_px = 0.0;  // median of the dots
  double edge_px = 0.0;    // deviation of the blur at their rim
};

/// From dots at known places. Throws SolverError if the colours do not tell them from the rest.
DotLook learn_look(const Image& linear_rgb, const std::vector<Spot>& dots);

/// The picture's part `rect` (cut to the picture) in the look's one channel.
Patch project_look(const Image& linear_rgb, const DotLook& look, const PixelRect& rect);

/// A local maximum of the look's channel, and how much it stands out (1: as much as the dots that
/// the look was learned from, roughly).
struct DotCandidate {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  // to about half a pixel
  double response = 0.0;
};

/// All that stand out by at least `least_response`, strongest first.
std::vector<DotCandidate> find_candidates(const Patch& patch, const DotLook& look,
                                          double least_response);

/// A dot's place by least squares: an ellipse with a blurred rim on a sloping background,
///   v(p) = b + g . (p - c) + a (1 - erf((|S (p - c)| - R) / (sqrt(2) e))) / 2,
/// for centre c, height a, background b, slope g, radius R and stretch S = I + [s t; t -s]; the
/// rim's blur e is the look's. Radius and stretch are held near the look's and zero.
struct DotFit {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  /// From the cost's curvature and the residual, and 3 % of the radius for what curved skin and
  /// uneven light do to a dot (measured on datasets-synthetic/lip-markers).
  Eigen::Vector2d sigma_px = Eigen::Vector2d::Zero();
  double height = 0.0, radius_px = 0.0;
  double residual_rms = 0.0;  // relative to the height
};

/// Nothing where the fit leaves the neighbourhood of `start_px` or the patch, or does not settle on
/// a dot of about the look's height and radius.
std::optional<DotFit> fit_dot(const Patch& patch, const DotLook& look,
                              const Eigen::Vector2d& start_px);

}  // namespace semblance
