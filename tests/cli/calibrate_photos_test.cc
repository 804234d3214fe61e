// `semblance calibrate photos` as a user runs it: marks of a drape, and COLMAP before a corner of
// textured walls that this test casts rays at.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "program.h"
#include "semblance/core/child_process.h"
#include "semblance/core/random.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/camera_rig.h"
#include "semblance/io/marks_io.h"
#include "support.h"

namespace semblance::testing {
namespace {

using ::testing::HasSubstr;

constexpr int kWidth = 800, kHeight = 600;
constexpr double kFocal_px = 920.0;

// A camera at `at` that looks towards `aim`, the world's z up.
Camera looking_at(const Eigen::Vector3d& at, const Eigen::Vector3d& aim) {
  const Eigen::Vector3d forward = (aim - at).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d rotation;
  rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  Camera camera = Camera::centred(kWidth, kHeight, kFocal_px);
  camera.camera_from_world = {Eigen::Quaterniond(rotation), -rotation * at};
  return camera;
}

Camera around(int i, int count, double from_rad, double span_rad, const Eigen::Vector3d& aim) {
  const double turn = from_rad + span_rad * i / count;
  const double up = 0.5 + 0.15 * std::sin(2.0 * i);
  return looking_at(1.9 * Eigen::Vector3d(std::cos(turn) * std::cos(up),
                                          std::sin(turn) * std::cos(up), std::sin(up)),
                    aim);
}

class CalibratePhotos : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  ProgramResult photos(std::vector<std::string> options) const {
    options.insert(options.begin(),
                   {"calibrate", "photos", "-o", path("out"), "--json", path("summary.json")});
    return run_program(options);
  }
  nlohmann::json summary() const { return nlohmann::json::parse(file_bytes(path("summary.json"))); }

  /// 25 marks of a cloth over a table in six photos, in half a pixel of noise; rough points 3 cm
  /// off. The pictures themselves are grey: marks come from the file.
  MarksFile drape() const {
    Random random(5);
    MarksFile marks;
    std::map<std::string, Eigen::Vector3d> truth;
    for (int row = -2; row <= 2; ++row) {
      for (int column = -2; column <= 2; ++column) {
        const double x = 0.15 * column, y = 0.12 * row;
        const double over = std::max({0.0, std::abs(x) - 0.2, std::abs(y) - 0.15});
        truth[std::to_string(10 * (row + 2) + column + 2)] = {
            x, y, -1.5 * over + 0.03 * std::sin(12.0 * (x + y))};
      }
    }
    for (const auto& [name, point] : truth) {
      marks.points_m[name] =
          point + 0.03 * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    }
    for (int i = 0; i < 6; ++i) {
      const Camera camera = around(i, 6, 0.0, 2.0 * std::numbers::pi, {0, 0, -0.1});
      const std::string file = path("photo" + std::to_string(i) + ".png");
      cv::imwrite(file, cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(128)));
      MarksFile::Photo photo{file, {}};
      for (const auto& [name, point] : truth) {
        photo.marks_px[name] =
            project_world(camera, point) + 0.5 * Eigen::Vector2d(random.normal(), random.normal());
      }
      marks.photos.push_back(std::move(photo));
    }
    marks.lengths = {{"0", "44", (truth["0"] - truth["44"]).norm(), 1e-4}};
    return marks;
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(CalibratePhotos, MarksGiveCameraAndPoints) {
  MarksFile marks = drape();
  const MarksFile::Length diagonal = marks.lengths[0];
  marks.axes = {"22", "23", "32"};
  write_marks(path("marks.json"), marks);
  const ProgramResult result = photos({"--marks", path("marks.json"), "--method", "both"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const nlohmann::json found = summary();
  const double sigma_px = found["focal_sigma_px"][0];
  EXPECT_LT(sigma_px, 15.0);
  EXPECT_NEAR(found["focal_px"][0], kFocal_px, 3.0 * sigma_px);
  EXPECT_NEAR(found["methods"][0]["rms_px"], found["methods"][1]["rms_px"], 0.01);
  const MarksFile placed = read_marks(path("out/points.json"));
  EXPECT_NEAR((placed.points_m.at("0") - placed.points_m.at("44")).norm(), diagonal.length_m, 1e-3);
  // The origin, a point on the x axis, and one in the xy plane.
  EXPECT_LT(placed.points_m.at("22").norm(), 1e-9);
  EXPECT_NEAR(placed.points_m.at("23").x(), std::hypot(0.15, 0.03 * std::sin(1.8)), 2e-3);
  EXPECT_LT(placed.points_m.at("23").tail<2>().norm(), 1e-9);
  EXPECT_GT(placed.points_m.at("32").y(), 0.1);
  EXPECT_NEAR(placed.points_m.at("32").z(), 0.0, 1e-9);
  EXPECT_EQ(read_rig(path("out/rig.json")).cameras.size(), 6U);
}

TEST_F(CalibratePhotos, MarksAloneAreEnough) {
  MarksFile marks = drape();
  marks.points_m.clear();
  write_marks(path("marks.json"), marks);
  const ProgramResult result = photos({"--marks", path("marks.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const double sigma_px = summary()["focal_sigma_px"][0];
  EXPECT_NEAR(summary()["focal_px"][0], kFocal_px, 3.0 * sigma_px);
  const MarksFile placed = read_marks(path("out/points.json"));
  EXPECT_NEAR((placed.points_m.at("0") - placed.points_m.at("44")).norm(),
              marks.lengths[0].length_m, 1e-3);
}

TEST_F(CalibratePhotos, KnownPointsGiveScaleAndAxes) {
  MarksFile marks = drape();
  marks.lengths.clear();
  write_marks(path("marks.json"), marks);
  ASSERT_EQ(photos({"--marks", path("marks.json")}).exit_code, 0);
  EXPECT_THAT(summary()["frame"]["by"].get<std::string>(), HasSubstr("25 known points"));
}

// A rig of known lenses is placed by marks whose points are known to 3 cm.
TEST_F(CalibratePhotos, KnownLensesArePlaced) {
  MarksFile marks = drape();
  marks.lengths.clear();
  CameraRig lenses;
  std::vector<Camera> truth;
  for (int i = 0; i < 6; ++i) {
    truth.push_back(around(i, 6, 0.0, 2.0 * std::numbers::pi, {0, 0, -0.1}));
    lenses.cameras.push_back(Camera::centred(kWidth, kHeight, kFocal_px));
    lenses.cameras.back().name = "lens " + std::to_string(i);
    marks.photos[static_cast<std::size_t>(i)].camera = lenses.cameras.back().name;
  }
  write_rig(path("lenses.json"), lenses);
  marks.points_sigma_m = 0.03;
  write_marks(path("marks.json"), marks);
  const ProgramResult result =
      photos({"--marks", path("marks.json"), "--cameras", path("lenses.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const nlohmann::json found = summary();
  ASSERT_EQ(found["cameras"].size(), 6U);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const nlohmann::json& camera = found["cameras"][i];
    EXPECT_EQ(camera["name"], "lens " + std::to_string(i));
    const Eigen::Vector3d at = truth[i].camera_from_world.inverse().translation_m;
    for (std::size_t k = 0; k < 3; ++k) {
      const double sigma_m = camera["centre_sigma_m"][k];
      EXPECT_LT(sigma_m, 0.06);  // mostly the frame's turn, as 25 points tell it
      EXPECT_NEAR(camera["centre_m"][k], at[static_cast<Eigen::Index>(k)], 4.0 * sigma_m) << i;
    }
  }
  EXPECT_FALSE(std::filesystem::exists(path("out/camera.json")));

  marks.photos[2].camera = "lens 9";
  write_marks(path("marks.json"), marks);
  const ProgramResult unknown =
      photos({"--marks", path("marks.json"), "--cameras", path("lenses.json")});
  EXPECT_EQ(unknown.exit_code, 3);
  EXPECT_THAT(unknown.output, HasSubstr("no stored camera is named 'lens 9'"));
}

TEST_F(CalibratePhotos, AMarkThatDoesNotFitIsNamed) {
  MarksFile marks = drape();
  marks.photos[3].marks_px["21"] += Eigen::Vector2d(25.0, -10.0);
  write_marks(path("marks.json"), marks);
  const ProgramResult result = photos({"--marks", path("marks.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("photo3.png: mark '21' does not fit the others"));
  const std::string page = file_bytes(path("out/report.html"));
  EXPECT_THAT(page, HasSubstr("photo3.png: marks, and lines"));
  EXPECT_THAT(page, HasSubstr(">21</text>"));
}

TEST_F(CalibratePhotos, TwoKnownPointsAreNoFrame) {
  MarksFile marks = drape();
  marks.points_sigma_m = 1e-3;
  std::erase_if(marks.points_m, [](const auto& entry) { return entry.first > "1"; });
  write_marks(path("marks.json"), marks);
  const ProgramResult result = photos({"--marks", path("marks.json")});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, HasSubstr("the photos show 2 of the known points"));
}

TEST_F(CalibratePhotos, BadMarksAreNamed) {
  MarksFile marks = drape();
  marks.photos.resize(1);
  write_marks(path("marks.json"), marks);
  ProgramResult result = photos({"--marks", path("marks.json")});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, HasSubstr("two photos"));
  marks = drape();
  marks.photos[1].marks_px["11"] = {9000.0, 3.0};
  write_marks(path("marks.json"), marks);
  result = photos({"--marks", path("marks.json")});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, HasSubstr("mark '11' at (9000, 3) is outside"));
  EXPECT_EQ(photos({}).exit_code, 2);
  EXPECT_EQ(photos({path("photo0.png"), "--marks", path("marks.json")}).exit_code, 2);
}

// A texture with detail at every size.
cv::Mat texture(std::uint64_t seed) {
  cv::theRNG().state = seed;
  constexpr int side = 700;
  cv::Mat sum = cv::Mat::zeros(side, side, CV_32F);
  for (int cells = 8; cells <= 256; cells *= 2) {
    cv::Mat noise(cells, cells, CV_32F), large;
    cv::randn(noise, 0.0, 1.0);
    cv::resize(noise, large, sum.size(), 0, 0, cv::INTER_CUBIC);
    sum += large / std::sqrt(static_cast<double>(cells));
  }
  cv::normalize(sum, sum, 0.0, 255.0, cv::NORM_MINMAX);
  return sum;
}

// The corner of a room: three square walls of side 1 at x = 0, y = 0 and z = 0.
cv::Mat cast_corner(const Camera& camera, const std::array<cv::Mat, 3>& walls) {
  cv::Mat picture(kHeight, kWidth, CV_32F, cv::Scalar(60));
  const Rigid3 world_from_camera = camera.camera_from_world.inverse();
  const Eigen::Vector3d from = world_from_camera.translation_m;
  for (int wall = 0; wall < 3; ++wall) {
    cv::Mat x(kHeight, kWidth, CV_32F, cv::Scalar(-1)), y = x.clone(), seen;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const Eigen::Vector3d ray =
            world_from_camera.rotation * Eigen::Vector3d((u + 0.5 - 0.5 * kWidth) / kFocal_px,
                                                         (v + 0.5 - 0.5 * kHeight) / kFocal_px, 1);
        const Eigen::Vector3d hit = from - from[wall] / ray[wall] * ray;
        const double a = hit[(wall + 1) % 3], b = hit[(wall + 2) % 3];
        if (a < 0 || b < 0 || a > 1 || b > 1) continue;
        x.at<float>(v, u) = static_cast<float>(a * 699);
        y.at<float>(v, u) = static_cast<float>(b * 699);
      }
    }
    cv::remap(walls[static_cast<std::size_t>(wall)], seen, x, y, cv::INTER_LINEAR);
    seen.copyTo(picture, x >= 0);
  }
  return picture;
}

TEST_F(CalibratePhotos, ColmapPlacesPhotosWithoutMarks) {
  if (!find_program("colmap")) GTEST_SKIP() << "needs the program colmap";
  const std::array<cv::Mat, 3> walls{texture(1), texture(2), texture(3)};
  const Eigen::Vector3d aim(0.3, 0.3, 0.25);
  MarksFile marks;
  marks.points_m = {{"corner", {0, 0, 0}}, {"x", {1, 0, 0}}, {"y", {0, 1, 0}}, {"z", {0, 0, 1}}};
  std::vector<std::string> options{"--colmap", "--marks", path("marks.json")};
  std::vector<Camera> cameras;
  for (int i = 0; i < 6; ++i) {
    cameras.push_back(around(i, 6, 0.45, 0.9, aim));
    const std::string file = path("photo; $(" + std::to_string(i) + ").jpg");
    cv::imwrite(file, cast_corner(cameras.back(), walls), {cv::IMWRITE_JPEG_QUALITY, 95});
    MarksFile::Photo photo{file, {}};
    for (const auto& [name, point] : marks.points_m) {
      photo.marks_px[name] = project_world(cameras.back(), point);
    }
    marks.photos.push_back(std::move(photo));
    options.push_back(file);
  }
  write_marks(path("marks.json"), marks);
  const ProgramResult result = photos(options);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const nlohmann::json found = summary();
  EXPECT_EQ(found["photos"], 6);
  EXPECT_NEAR(found["focal_px"][0], kFocal_px, 0.01 * kFocal_px);
  const CameraRig rig = read_rig(path("out/rig.json"));
  ASSERT_EQ(rig.cameras.size(), 6U);
  RecordProperty("focal_px", found["focal_px"][0].dump());
  double worst_m = 0.0;
  for (const Camera& camera : rig.cameras) {
    const std::size_t i = static_cast<std::size_t>(camera.name[camera.name.size() - 2] - '0');
    const Eigen::Vector3d at = camera.camera_from_world.inverse().translation_m;
    const Eigen::Vector3d truth = cameras[i].camera_from_world.inverse().translation_m;
    EXPECT_LT((at - truth).norm(), 0.01) << camera.name;
    worst_m = std::max(worst_m, (at - truth).norm());
  }
  RecordProperty("worst_place_mm", std::to_string(1e3 * worst_m));
}

}  // namespace
}  // namespace semblance::testing
