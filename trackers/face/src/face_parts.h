// What is known of a face's size and colours before any image of it was seen.
#pragma once

#include <array>
#include <vector>

#include "semblance/core/camera.h"
#include "semblance/core/mesh.h"
#include "semblance/cost/contour.h"
#include "semblance/cost/observation.h"
#include "semblance/cost/surface_equations.h"
#include "semblance/models/morph_model.h"

namespace semblance {

constexpr double kEyeDistance_m = 0.063;  // mean of adults (Dodgson 2004: 63.4 mm)
/// Distance between the eyes in pixels for the depth at x (pose first).
double eye_distance_px(const Camera& camera, const Eigen::VectorXd& x);
/// Pyramid level at which eyes that far apart at full resolution are about `wanted_px` apart.
int level_for(const Observation& observation, double eyes_px, double wanted_px);

/// Albedo relative to the skin (linear, per channel), for the parts of a face.
Eigen::Vector3f relative_albedo(FacePart part);
/// How far the relative albedo can be trusted when no image has shown the part, in [0, 1].
float colour_confidence(FacePart part);
/// How rigidly a part follows the model, as a weight of its pixels while tracking, in [0, 1].
float tracking_weight(FacePart part);

/// The same for every vertex of a shape.
PointsF vertex_albedo(const MorphShape& shape);
std::vector<float> vertex_confidence(const MorphShape& shape);
/// While tracking, a guessed colour counts little beside those that were seen.
std::vector<float> unseen_confidence(const MorphShape& shape);
/// Colour that a triangle has on most faces, relative to the skin, and how far that can be trusted.
struct GenericColour {
  Eigen::Vector3f encoded;
  float confidence;
};
std::vector<GenericColour> generic_colours(const MorphShape& shape,
                                           const SurfaceTopology& topology);
/// 1 inside the oval of brows, eyes, nose, mouth and chin, falling to 0 around it: the part of a
/// face that is neither hair nor neck nor background, whoever's it is.
std::vector<float> inner_face_weight(const MorphShape& shape, const SurfaceTopology& topology);
/// Weights of triangles where the model's surface is the face's: without the hair, which stands
/// off the head, and without the top of the forehead, which it may cover.
std::vector<float> bare_face_weight(const MorphShape& shape, const SurfaceTopology& topology);
/// The foremost triangle of each iris, that of the face's right eye (left in the image) first; -1
/// where the shape has none.
std::array<int, 2> pupil_triangles(const MorphShape& shape, const SurfaceTopology& topology);
/// How far the outline of the face there is that of its skin: 1 in front, falling to 0 where the
/// head turns towards the ears, whose outline is hair as often; 0 off the skin.
std::vector<float> contour_weight(const MorphShape& shape);
/// How to compare that outline where the eyes are so far apart.
ContourOptions contour_options(double eyes_px);
/// Weight of each triangle: the least of its corners'.
std::vector<float> triangle_weights(const MorphShape& shape, const SurfaceTopology& topology,
                                    float (*weight)(FacePart));

}  // namespace semblance
