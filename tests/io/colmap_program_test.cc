// COLMAP itself reads what is written here: a model of exact cameras is triangulated by it from
// exact pictures of points, and read back. Needs the program colmap (apt-get install colmap).
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "files.h"
#include "semblance/io/colmap.h"
#include "some_rig.h"
#include "support.h"

namespace semblance {
namespace {

using testing::some_camera;
using testing::TemporaryFolder;

constexpr int point_count = 60;

std::vector<Eigen::Vector3d> scattered_points() {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < point_count; ++i) {
    points.emplace_back(0.45 * std::sin(1.7 * i), 0.3 * std::cos(2.3 * i), 0.3 * std::sin(0.9 * i));
  }
  return points;
}

/// One camera of every lens, around the points. COLMAP numbers the pictures of a folder by their
/// names, and wants the model to have the same numbers.
CameraRig rig_around() {
  CameraRig rig;
  double turn_rad = -0.5;
  for (const Lens lens : all_lenses) {
    const std::string number = std::to_string(rig.cameras.size());
    rig.cameras.push_back(
        some_camera(number + "-" + std::string(lens_name(lens)) + ".png", lens, turn_rad += 0.25));
  }
  return rig;
}

class ColmapProgram : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::system("colmap help >/dev/null 2>&1") != 0) {
      GTEST_SKIP() << "needs the program colmap (apt-get install --no-install-recommends colmap)";
    }
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  void colmap(const std::string& arguments) const {
    const std::string command = "cd " + folder_.path().string() +
                                " && QT_QPA_PLATFORM=offscreen colmap " + arguments + " >>log 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0) << command << "\n"
                                               << testing::read_text(path("log"));
  }

  /// Black pictures, and beside them where each point is seen: COLMAP's own import format.
  void write_features(const CameraRig& rig, const std::vector<Eigen::Vector3d>& points) const {
    std::filesystem::create_directory(path("images"));
    std::filesystem::create_directory(path("features"));
    for (const Camera& camera : rig.cameras) {
      cv::imwrite(path("images/" + camera.name),
                  cv::Mat::zeros(camera.height, camera.width, CV_8U));
      std::ofstream file(path("features/" + camera.name + ".txt"));
      file.precision(17);
      file << points.size() << " 128\n";
      for (const Eigen::Vector3d& point : points) {
        file << project_world(camera, point).transpose() << " 1 0";
        for (int i = 0; i < 128; ++i) file << " 1";
        file << '\n';
      }
    }
  }
  /// Point i is feature i in every picture.
  void write_matches(const CameraRig& rig) const {
    std::ofstream file(path("matches.txt"));
    for (std::size_t a = 0; a < rig.cameras.size(); ++a) {
      for (std::size_t b = a + 1; b < rig.cameras.size(); ++b) {
        file << rig.cameras[a].name << ' ' << rig.cameras[b].name << '\n';
        for (int i = 0; i < point_count; ++i) file << i << ' ' << i << '\n';
        file << '\n';
      }
    }
  }
  void triangulate(const std::string& model) const {
    colmap("feature_importer --database_path db --image_path images --import_path features");
    colmap(
        "matches_importer --database_path db --match_list_path matches.txt "
        "--match_type inliers --SiftMatching.use_gpu 0");
    std::filesystem::create_directory(path("out"));
    colmap("point_triangulator --database_path db --image_path images --input_path " + model +
           " --output_path out");
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(ColmapProgram, TriangulatesOurModelToTheTruth) {
  const CameraRig rig = rig_around();
  const std::vector<Eigen::Vector3d> points = scattered_points();
  write_features(rig, points);
  write_matches(rig);
  write_colmap_text(path("model"), colmap_from_rig(rig));
  triangulate("model");
  const ColmapModel found = read_colmap(path("out"));
  const CameraRig back = rig_from_colmap(found);
  ASSERT_EQ(back.cameras.size(), rig.cameras.size());
  double largest = 0.0;  // rad or m
  for (const Camera& camera : rig.cameras) {
    const auto same = std::find_if(back.cameras.begin(), back.cameras.end(),
                                   [&](const Camera& one) { return one.name == camera.name; });
    ASSERT_NE(same, back.cameras.end()) << camera.name;
    const Rigid3 change = same->camera_from_world * camera.camera_from_world.inverse();
    EXPECT_LT(rotation_vector_from_quaternion(change.rotation).norm(), 1e-6) << camera.name;
    EXPECT_LT(change.translation_m.norm(), 1e-6) << camera.name;
    largest = std::max({largest, change.translation_m.norm(),
                        rotation_vector_from_quaternion(change.rotation).norm()});
  }
  RecordProperty("largest_change_in_1e-15", std::to_string(1e15 * largest));
  // Its pixels are stored in single precision: 3e-5 px, over 600 px of focal length, at 2.5 m.
  ASSERT_EQ(found.points.size(), points.size());
  for (const auto& [id, point] : found.points) {
    EXPECT_EQ(point.track.size(), rig.cameras.size());
    const Eigen::Vector3d& truth = points[point.track[0].observation];
    EXPECT_LT((point.position - truth).norm(), 1e-6);
    EXPECT_LT(point.error_px, 1e-3);
  }
}

TEST_F(ColmapProgram, ReadsOurBinaryModelsAndWritesThemBackTheSame) {
  write_colmap_binary(path("model"), colmap_from_rig(rig_around()));
  std::filesystem::create_directory(path("text"));
  colmap("model_converter --input_path model --output_path text --output_type TXT");
  const CameraRig back = rig_from_colmap(read_colmap(path("text")));
  const CameraRig rig = rig_around();
  ASSERT_EQ(back.cameras.size(), rig.cameras.size());
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    EXPECT_EQ(back.cameras[i].name, rig.cameras[i].name);
    EXPECT_EQ(back.cameras[i].lens, rig.cameras[i].lens);
    EXPECT_LT(testing::largest_difference_px(back.cameras[i], rig.cameras[i]), 1e-9);
  }
}

}  // namespace
}  // namespace semblance
