// Calibrations as other programs wrote them, against what they were made from.
#include <gmock/gmock.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "semblance/io/camera_formats.h"
#include "support.h"

namespace semblance {
namespace {

using testing::data_path;

CameraRig rig_of(const std::string& relative, const std::string& format) {
  const std::string path = data_path(relative).string();
  EXPECT_EQ(recognise_camera_file(path).name, format);
  return read_cameras(path, *find_camera_format(format)).rig;
}

// Caliscope's marks in the pictures and their places, with the cameras it found for them. A wrong
// half pixel, either way, makes them worse.
TEST(CalibrationFiles, CaliscopesPointsFallOnItsMarks) {
  SEMBLANCE_NEED_DATA("calibration/charuco-4cam/camera_array.toml");
  const CameraRig rig = rig_of("calibration/charuco-4cam/camera_array.toml", "caliscope");
  ASSERT_EQ(rig.cameras.size(), 4u);
  const std::filesystem::path folder = data_path("calibration/charuco-4cam/calibration/extrinsic");
  std::map<std::pair<int, int>, Eigen::Vector3d> places;
  std::string line;
  for (std::ifstream file(folder / "CHARUCO/xyz_CHARUCO.csv"); std::getline(file, line);) {
    int sync = 0, object = 0, key = 0;
    Eigen::Vector3d p;
    if (std::sscanf(line.c_str(), "%d,%d,%d,%lf,%lf,%lf", &sync, &object, &key, &p.x(), &p.y(),
                    &p.z()) == 6) {
      places[{sync, key}] = p;
    }
  }
  const auto rms_px = [&](double shift_px) {
    double sum = 0.0;
    int count = 0;
    for (std::ifstream file(folder / "xy.csv"); std::getline(file, line);) {
      int sync = 0, camera = 0, frame = 0, object = 0, key = 0;
      double time_s = 0.0;
      Eigen::Vector2d mark;
      if (std::sscanf(line.c_str(), "%d,%d,%d,%lf,%d,%d,%lf,%lf", &sync, &camera, &frame, &time_s,
                      &object, &key, &mark.x(), &mark.y()) != 8 ||
          places.count({sync, key}) == 0) {
        continue;
      }
      mark.array() += 0.5 + shift_px;  // OpenCV's marks
      const Camera& seen_by = rig.cameras[static_cast<std::size_t>(camera)];
      sum += (project_world(seen_by, places.at({sync, key})) - mark).squaredNorm();
      ++count;
    }
    EXPECT_EQ(count, 2175);
    return std::sqrt(sum / count);
  };
  const double rms = rms_px(0.0);
  EXPECT_LT(rms, 1.7);
  EXPECT_GT(rms_px(0.5), rms);
  EXPECT_GT(rms_px(-0.5), rms);
}

// The published poses of the views put the board's corners where OpenCV says.
TEST(CalibrationFiles, OpenCvsOwnExampleProjectsAsInOpenCv) {
  SEMBLANCE_NEED_DATA("calibration/chessboard-left/left_intrinsics.yml");
  Camera camera = rig_of("calibration/chessboard-left/left_intrinsics.yml", "opencv").cameras[0];
  const cv::FileStorage in(data_path("calibration/chessboard-left/left_intrinsics.yml").string(),
                           cv::FileStorage::READ);
  cv::Mat matrix, distortion, views;
  in["camera_matrix"] >> matrix;
  in["distortion_coefficients"] >> distortion;
  in["extrinsic_parameters"] >> views;
  ASSERT_EQ(views.rows, 13);
  for (int view = 0; view < views.rows; ++view) {
    const cv::Mat rvec = views.row(view).colRange(0, 3), tvec = views.row(view).colRange(3, 6);
    camera.camera_from_world = {quaternion_from_rotation_vector(
                                    {rvec.at<double>(0), rvec.at<double>(1), rvec.at<double>(2)}),
                                {tvec.at<double>(0), tvec.at<double>(1), tvec.at<double>(2)}};
    const std::vector<cv::Point3d> corners{{0, 0, 0}, {0.2, 0, 0}, {0, 0.125, 0}, {0.2, 0.125, 0}};
    std::vector<cv::Point2d> pixels;
    cv::projectPoints(corners, rvec, tvec, matrix, distortion, pixels);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Eigen::Vector2d ours =
          project_world(camera, {corners[i].x, corners[i].y, corners[i].z});
      EXPECT_NEAR(ours.x(), pixels[i].x + 0.5, 1e-9);
      EXPECT_NEAR(ours.y(), pixels[i].y + 0.5, 1e-9);
    }
  }
}

// The four cameras stand around the beam, above its floor (z up, metres), upright, and look at it.
TEST(CalibrationFiles, QualisysCamerasLookAtTheBeam) {
  SEMBLANCE_NEED_DATA("body/beam-4cam/calibration/Calib.qca.txt");
  const CameraRig rig = rig_of("body/beam-4cam/calibration/Calib.qca.txt", "qualisys");
  ASSERT_EQ(rig.cameras.size(), 4u);
  for (const Camera& camera : rig.cameras) {
    EXPECT_EQ(camera.width, 1088);
    EXPECT_EQ(camera.height, 1920);
    const Eigen::Vector3d place = camera.camera_from_world.inverse().translation_m;
    EXPECT_GT(place.z(), 1.5);
    EXPECT_LT(place.norm(), 5.0);
    // The ends of the beam (Config.toml, object_coords_3d) are in the picture of all four.
    for (const Eigen::Vector3d& end : {Eigen::Vector3d(-2, 0, 0.05), Eigen::Vector3d(0, 0, 0.05)}) {
      EXPECT_GT((camera.camera_from_world * end).z(), 1.0);
      const Eigen::Vector2d seen = project_world(camera, end);
      EXPECT_TRUE((seen.array() > 0.0).all() && seen.x() < 1088 && seen.y() < 1920) << camera.name;
      EXPECT_LT(project_world(camera, end + Eigen::Vector3d(0, 0, 0.5)).y(), seen.y());
    }
  }
}

// Qualisys's distortion is OpenCV's, not in 64ths: a calibration from the stills agrees.
TEST(CalibrationFiles, QualisysDistortionIsThatOfTheStills) {
  SEMBLANCE_NEED_DATA("body/beam-4cam/calibration/intrinsics");
  const CameraRig rig = rig_of("body/beam-4cam/calibration/Calib.qca.txt", "qualisys");
  const Camera& camera = rig.cameras[0];
  std::vector<cv::Point3f> board;
  for (int i = 0; i < 28; ++i) {
    board.emplace_back(0.06f * static_cast<float>(i % 4), 0.06f * static_cast<float>(i / 4), 0.0f);
  }
  std::vector<std::vector<cv::Point2f>> corners;
  for (int i = 1; i <= 7; ++i) {
    const std::string name = "body/beam-4cam/calibration/intrinsics/int_cam01_img/cam01_0" +
                             std::to_string(i) + "_int.jpg";
    const cv::Mat image = cv::imread(data_path(name).string(), cv::IMREAD_GRAYSCALE);
    std::vector<cv::Point2f> found;
    if (!cv::findChessboardCorners(image, {4, 7}, found)) continue;
    cv::cornerSubPix(image, found, {5, 5}, {-1, -1}, {3, 40, 1e-3});
    corners.push_back(found);
  }
  ASSERT_GE(corners.size(), 6u);
  cv::Mat matrix, distortion, rotations, translations;
  cv::calibrateCamera(std::vector(corners.size(), board), corners, {1088, 1920}, matrix, distortion,
                      rotations, translations, cv::CALIB_FIX_K3);
  EXPECT_NEAR(camera.focal_px.x(), matrix.at<double>(0, 0), 5.0);
  EXPECT_NEAR(camera.distortion[0], distortion.at<double>(0), 0.02);  // a 64th would be -0.0007
  EXPECT_NEAR(camera.distortion[1], distortion.at<double>(1), 0.06);
}

}  // namespace
}  // namespace semblance
