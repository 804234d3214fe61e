#include <gmock/gmock.h>

#include "semblance/models/contract.h"
#include "semblance/models/load_face.h"
#include "support.h"

namespace semblance {
namespace {

TEST(IctFace, IsAFaceInOurFrame) {
  SEMBLANCE_NEED_DATA("face/ict-facekit/generic_neutral_mesh.obj");
  const MorphShape face = load_face(testing::data_path("face/ict-facekit"), {.identity_limit = 10});
  EXPECT_EQ(face.identity_count, 10);
  EXPECT_GE(face.parameters.size(), 10u + 50u);
  ASSERT_EQ(face.landmarks.size(), 68u);
  // Eyeballs at equal distance left and right of the origin, as human ones are.
  Eigen::RowVector3d left = Eigen::RowVector3d::Zero();
  int count = 0;
  for (std::size_t v = 0; v < face.part.size(); ++v) {
    const bool is_eye = face.part[v] >= static_cast<int>(FacePart::sclera) &&
                        face.part[v] <= static_cast<int>(FacePart::pupil);
    if (!is_eye || face.mesh->positions_m(static_cast<Eigen::Index>(v), 0) < 0) continue;
    left += face.mesh->positions_m.row(static_cast<Eigen::Index>(v));
    ++count;
  }
  left /= count;
  EXPECT_NEAR(2 * left.x(), 0.0625, 0.004);
  EXPECT_NEAR(left.y(), 0.0, 0.001);
  const MorphModel model(face);
  Scene scene;
  Eigen::VectorXd x = model.parameters().initial();
  model.synthesize(x, scene);
  const auto at = [&](int i) { return landmark_position(face.landmarks[i], scene); };
  EXPECT_LT(at(0).x(), 0) << "the first is on the face's right";
  EXPECT_GT(at(30).z(), at(27).z()) << "the nose's tip is in front of its root";
  EXPECT_LT(at(8).y(), at(57).y()) << "the chin is below the lips";
  const double chin_y = at(8).y(), lid_gap = at(43).y() - at(47).y();
  x[model.parameters().offset(model.parameters().block_index("jaw_open"))] = 1.0;
  x[model.parameters().offset(model.parameters().block_index("eye_blink_left"))] = 1.0;
  model.synthesize(x, scene);
  EXPECT_LT(at(8).y(), chin_y - 0.01);
  EXPECT_LT(at(43).y() - at(47).y(), 0.4 * lid_gap) << "the left eye closes";
}

TEST(IctFace, MeetsTheContract) {
  SEMBLANCE_NEED_DATA("face/ict-facekit/generic_neutral_mesh.obj");
  EXPECT_MODEL_CONTRACT(
      MorphModel(load_face(testing::data_path("face/ict-facekit"), {.identity_limit = 2})));
}

}  // namespace
}  // namespace semblance
