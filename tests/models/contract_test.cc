// The contract must catch models that break it.
#include "semblance/models/contract.h"

#include <gmock/gmock.h>

#include <limits>

#include "small_face.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;

/// A sound model with one thing broken at a time.
class Broken : public MorphModel {
 public:
  enum class Fault { jacobian, image_jacobian, memory, light, bounds, dead, landmark };
  explicit Broken(Fault fault) : MorphModel(shape_for(fault)), fault_(fault) {}

  void synthesize(const Eigen::VectorXd& x, Scene& scene) const override {
    const bool had_objects = !scene.objects.empty();
    MorphModel::synthesize(x, scene);
    PointsF& positions = scene.objects[0].positions_m;
    if (fault_ == Fault::memory && had_objects) positions(0, 0) += 1.0f;
    if (fault_ == Fault::light) scene.light = ShLight{};
    if (fault_ == Fault::bounds && x[8] == 1.0) {
      positions(0, 0) = std::numeric_limits<float>::quiet_NaN();
    }
  }

  bool vertex_jacobian(const Eigen::VectorXd& x, const std::vector<int>& columns,
                       const std::vector<int>* vertices, VertexJacobian& out) const override {
    MorphModel::vertex_jacobian(x, columns, vertices, out);
    if (fault_ == Fault::jacobian) out *= 1.1f;
    return true;
  }

  bool image_jacobian(const Eigen::VectorXd& x, const std::vector<int>& columns,
                      const std::vector<int>& vertices,
                      const std::vector<ImageFromWorld>& image_from_world,
                      VertexJacobian& out) const override {
    MorphModel::image_jacobian(x, columns, vertices, image_from_world, out);
    if (fault_ == Fault::image_jacobian) out.row(1) *= 1.1f;
    return true;
  }

  const std::vector<ModelLandmark>& landmarks() const override {
    static const std::vector<ModelLandmark> outside = {{"far", 1000000, {1, 0, 0}}};
    return fault_ == Fault::landmark ? outside : MorphModel::landmarks();
  }

 private:
  static MorphShape shape_for(Fault fault) {
    MorphShape shape = testing::small_face();
    if (fault == Fault::dead) {
      shape.parameters.push_back(scalar_block("dead", "1", 0, 1, 0, 0.3, "moves nothing"));
    }
    return shape;
  }

  Fault fault_;
};

TEST(ModelContract, CatchesAWrongJacobian) {
  EXPECT_THAT(model_contract_violations(Broken(Broken::Fault::jacobian)),
              HasSubstr("Jacobian of bend[0] is off"));
}
TEST(ModelContract, CatchesAWrongImageJacobian) {
  EXPECT_THAT(model_contract_violations(Broken(Broken::Fault::image_jacobian)),
              HasSubstr("image Jacobian is not the projected"));
}
TEST(ModelContract, CatchesMemoryOfTheScene) {
  EXPECT_THAT(model_contract_violations(Broken(Broken::Fault::memory)),
              HasSubstr("depend on what the scene held before"));
}
TEST(ModelContract, CatchesAChangedLight) {
  EXPECT_THAT(model_contract_violations(Broken(Broken::Fault::light)), HasSubstr("light"));
}
TEST(ModelContract, CatchesNonFiniteBounds) {
  EXPECT_THAT(model_contract_violations(Broken(Broken::Fault::bounds)),
              HasSubstr("not finite with bend at a bound"));
}
TEST(ModelContract, CatchesADeadParameter) {
  EXPECT_THAT(model_contract_violations(Broken(Broken::Fault::dead)),
              HasSubstr("dead[0] moves nothing"));
}
TEST(ModelContract, CatchesALandmarkOutside) {
  EXPECT_THAT(model_contract_violations(Broken(Broken::Fault::landmark)),
              HasSubstr("landmark far names triangle 1000000"));
}

}  // namespace
}  // namespace semblance
