// What every ParametricModel must satisfy, as a function that the test of a new model can call. It
// needs no test framework; the macro at the end is for GoogleTest.
#pragma once

#include <string>

#include "semblance/models/parametric_model.h"

namespace semblance {

struct ModelAccuracy {
  /// Every parameter moves some vertex at least this far when it goes by its tangent_scale().
  double least_motion_m = 1e-6;
  /// Allowed between Jacobian and central differences, for a step of tangent_scale(): part of the
  /// motion, plus metres (positions are floats).
  double relative = 2e-3;
  double absolute_m = 1e-5;
  int points = 3;  // random places where the Jacobian is compared
};

/// One line for each broken promise, empty if there is none. Checked: positions and normals are
/// finite with every parameter at its bounds; the same x gives the same bytes, whatever the scene
/// held before and however many threads ask at once; materials, light and background are left
/// alone; every parameter moves a vertex; the Jacobian, if any, equals central differences, also
/// for some columns and vertices only, and leaves the other rows alone; landmarks have different
/// names and lie inside triangles of the scene.
std::string model_contract_violations(const ParametricModel& model,
                                      const ModelAccuracy& accuracy = {});

}  // namespace semblance

#define EXPECT_MODEL_CONTRACT(model) EXPECT_EQ("", ::semblance::model_contract_violations(model))
