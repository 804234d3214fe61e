// The scanned head with its texture as calibration target.
#include <gtest/gtest.h>

#include "object_scene.h"
#include "semblance/io/image_io.h"
#include "semblance/io/mesh_io.h"
#include "support.h"

namespace semblance::testing {
namespace {

TEST(HeadAsTarget, ThreePicturesGiveTheCamera) {
  const std::string folder = "face/lee-perry-smith/";
  SEMBLANCE_NEED_DATA(folder + "LeePerrySmith.obj");
  Mesh mesh = read_obj(data_path(folder + "LeePerrySmith.obj").string()).mesh;
  mesh.positions_m *= 0.6;  // about a head's size
  const ObjectScene scene(std::move(mesh), read_image(data_path(folder + "Map-COL.jpg").string()),
                          {.click_px = 4.0, .pairs = 8});
  const ObjectTarget target = make_object_target(scene.mesh(), scene.texture(), "head");
  const Camera camera = test_camera(900.0);
  std::vector<ObjectPicture> pictures;
  std::vector<Rigid3> truth;
  for (const double yaw : {-0.5, 0.1, 0.6}) {
    // The head's y is up, the camera's down.
    const Eigen::Quaterniond turn = Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()) *
                                    Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY());
    truth.push_back({turn, {0.01, -0.03, 0.75}});
    pictures.push_back(scene.picture(camera, truth.back(), truth.size()));
  }
  const ObjectCalibration found = calibrate_object(target, pictures, {});
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    const ObjectErrors before = errors_of(found.from_pairs, k, truth[k], camera);
    const ObjectErrors after = errors_of(*found.refined, k, truth[k], camera);
    EXPECT_LT(after.turn_deg, 0.2);
    EXPECT_LT(after.turn_deg, before.turn_deg);
    EXPECT_LT(std::abs(after.focal_share), 0.01);
  }
}

}  // namespace
}  // namespace semblance::testing
