#include "semblance/io/camera_formats.h"

#include <gmock/gmock.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "files.h"
#include "semblance/core/errors.h"
#include "semblance/io/camera_io.h"
#include "some_rig.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::largest_difference_px;
using testing::read_text;
using testing::some_camera;
using testing::some_rig;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

// Rounding of figures of 1e3 pixels.
constexpr double exact_px = 1e-9;

class CameraFormats : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  /// What is in a file of this content, read as the program would without being told the format.
  CameraFile read(const std::string& name, const std::string& content,
                  double metres_per_unit = 1.0) const {
    write_text(path(name), content);
    return read_cameras(path(name), recognise_camera_file(path(name)), metres_per_unit);
  }
  std::string complaint(const std::string& name, const std::string& content,
                        const std::string& format) const {
    write_text(path(name), content);
    try {
      read_cameras(path(name), *find_camera_format(format));
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "no complaint";
  }

 private:
  TemporaryFolder folder_;
};

// Where a format's files go, and the lenses it holds.
struct Held {
  const char* format;
  const char* file;
  std::vector<Lens> lenses;
};

const std::vector<Lens> every_lens(all_lenses.begin(), all_lenses.end());
const std::vector<Held> held{
    {"semblance", "rig.json", every_lens},
    {"opencv", "pair.yml", every_lens},
    {"opencv", "pair.xml", every_lens},
    {"kalibr", "my-camchain.yaml", {Lens::pinhole, Lens::brown2, Lens::fisheye}},
    {"aniposelib", "calibration.toml", {Lens::pinhole, Lens::brown2, Lens::brown5, Lens::fisheye}},
    {"caliscope", "camera_array.toml", {Lens::pinhole, Lens::brown2, Lens::brown5, Lens::fisheye}},
    {"qualisys", "lab.qca.txt", {Lens::pinhole, Lens::brown2, Lens::brown5}},
    {"colmap-text", "text", every_lens},
    {"colmap-binary", "binary", every_lens}};

/// Moves the world, which Kalibr does not keep.
void move_first_to(std::vector<Camera>& cameras, const Rigid3& place) {
  const Rigid3 move = cameras[0].camera_from_world.inverse() * place;
  for (Camera& camera : cameras) camera.camera_from_world = camera.camera_from_world * move;
}

TEST_F(CameraFormats, KeepEveryLensTheyHoldAndRefuseTheOthers) {
  for (const Held& row : held) {
    const CameraFormat& format = *find_camera_format(row.format);
    for (const Lens lens : all_lenses) {
      SCOPED_TRACE(std::string(row.file) + " " + std::string(lens_name(lens)));
      const CameraRig rig = some_rig(lens);
      const std::string file = path(row.file);
      std::filesystem::remove_all(file);
      if (std::find(row.lenses.begin(), row.lenses.end(), lens) == row.lenses.end()) {
        EXPECT_THAT([&] { write_cameras(file, {.rig = rig}, format); },
                    ThrowsMessage<InvalidInput>(AllOf(HasSubstr(file), HasSubstr("'cam_0'"),
                                                      HasSubstr(std::string(lens_name(lens))),
                                                      HasSubstr(row.format))));
        EXPECT_FALSE(std::filesystem::exists(file));
        continue;
      }
      write_cameras(file, {.rig = rig}, format);
      EXPECT_EQ(recognise_camera_file(file).name, row.format);
      std::vector<Camera> found = read_cameras(file, format).rig.cameras;
      ASSERT_EQ(found.size(), 2u);
      if (format.name == "kalibr") move_first_to(found, rig.cameras[0].camera_from_world);
      for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(found[i].lens, lens);
        EXPECT_EQ(found[i].width, 640);
        EXPECT_EQ(found[i].height, 480);
        EXPECT_LT(largest_difference_px(found[i], rig.cameras[i]), exact_px);
      }
    }
  }
}

TEST_F(CameraFormats, KeepNamesWhereTheyHaveThem) {
  CameraRig rig = some_rig(Lens::brown2);
  rig.cameras[0].name = "left \"eye\" \\ é";
  for (const char* file : {"rig.json", "a.toml", "lab.qca.txt"}) {
    const CameraFormat& format = format_for_writing(path(file));
    EXPECT_EQ(write_cameras(path(file), {.rig = rig}, format).size(),
              format.name == "qualisys" ? 1u : 0u);
    EXPECT_EQ(read_cameras(path(file), format).rig.cameras[0].name, rig.cameras[0].name) << file;
  }
  for (const char* file : {"x-camchain.yaml", "camera_array.toml", "pair.yml"}) {
    EXPECT_THAT(write_cameras(path(file), {.rig = rig}, format_for_writing(path(file))),
                Contains(HasSubstr("'left")))
        << file;
  }
  rig.cameras.resize(1);
  write_cameras(path("one.xml"), {.rig = rig}, *find_camera_format("opencv"));
  EXPECT_EQ(read_cameras(path("one.xml"), *find_camera_format("opencv")).rig.cameras[0].name,
            rig.cameras[0].name);
}

TEST_F(CameraFormats, RefuseNamesThatNotAllCanHold) {
  for (const std::string& name :
       {std::string("a\nb"), std::string("\xff"), std::string(2000, 'a')}) {
    Camera camera = some_camera(name, Lens::pinhole);
    for (const CameraFormat* format : camera_formats()) {
      EXPECT_THAT([&] { write_cameras(path("x"), {.rig = {{camera}}}, *format); },
                  ThrowsMessage<InvalidInput>(HasSubstr("a name must be UTF-8")));
    }
  }
  EXPECT_FALSE(std::filesystem::exists(path("x")));
}

TEST_F(CameraFormats, AreGuessedByTheNameWhenWriting) {
  EXPECT_EQ(format_for_writing("a.json").name, "semblance");
  EXPECT_EQ(format_for_writing("a.QCA.yml").name, "opencv");
  EXPECT_EQ(format_for_writing("a.qca.txt").name, "qualisys");
  EXPECT_EQ(format_for_writing("data-camchain.yaml").name, "kalibr");
  EXPECT_EQ(format_for_writing("camera_array.toml").name, "caliscope");
  EXPECT_EQ(format_for_writing("calibration.toml").name, "aniposelib");
  EXPECT_EQ(format_for_writing("sparse/0").name, "colmap-text");
  EXPECT_THAT([] { format_for_writing("cameras.csv"); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr("--to"), HasSubstr("kalibr"))));
  write_text(path("notes.txt"), "some text");
  EXPECT_THAT([&] { recognise_camera_file(path("notes.txt")); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr("--from"), HasSubstr("opencv"))));
  EXPECT_THROW(recognise_camera_file(path("absent.json")), IoError);
}

// --- OpenCV

std::vector<cv::Point3d> points_in_view() {
  std::vector<cv::Point3d> points;
  for (int i = 0; i < 20; ++i) {
    points.emplace_back(-0.4 + 0.04 * i, 0.3 - 0.03 * i, 0.1 * (i % 5) - 0.2);
  }
  return points;
}

TEST_F(CameraFormats, OpenCvReadsWhatIsWrittenAndProjectsTheSame) {
  for (const char* file : {"one.yml", "one.xml"}) {
    for (const Lens lens : all_lenses) {
      const Camera camera = some_camera("c", lens);
      write_cameras(path(file), {.rig = {{camera}}}, *find_camera_format("opencv"));
      const cv::FileStorage in(path(file), cv::FileStorage::READ);
      ASSERT_TRUE(in.isOpened());
      cv::Mat matrix, distortion, rvec, tvec;
      in["camera_matrix"] >> matrix;
      in["distortion_coefficients"] >> distortion;
      in["rvec"] >> rvec;
      in["tvec"] >> tvec;
      EXPECT_EQ(static_cast<int>(in["image_width"]), 640);
      const std::vector<cv::Point3d> points = points_in_view();
      std::vector<cv::Point2d> pixels;
      if (static_cast<int>(in["fisheye_model"]) != 0) {
        cv::fisheye::projectPoints(points, pixels, rvec, tvec, matrix, distortion);
      } else {
        cv::projectPoints(points, rvec, tvec, matrix, distortion, pixels);
      }
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Eigen::Vector2d ours = project_world(camera, {points[i].x, points[i].y, points[i].z});
        EXPECT_NEAR(ours.x(), pixels[i].x + 0.5, exact_px) << lens_name(lens);
        EXPECT_NEAR(ours.y(), pixels[i].y + 0.5, exact_px) << lens_name(lens);
      }
    }
  }
}

TEST_F(CameraFormats, ReadWhatOpenCvsCalibrationSampleWrites) {
  const cv::Mat matrix = (cv::Mat_<double>(3, 3) << 535.9, 0, 342.3, 0, 536.1, 235.6, 0, 0, 1);
  const cv::Mat distortion = (cv::Mat_<double>(5, 1) << -0.27, -0.04, 0.0018, -0.0003, 0.24);
  for (const char* file : {"out.yml", "out.xml"}) {
    cv::FileStorage out(path(file), cv::FileStorage::WRITE);
    out << "calibration_time"
        << "Sat 1 Jan"
        << "nr_of_frames" << 13 << "image_width" << 640 << "image_height" << 480 << "flags" << 0
        << "fisheye_model" << 0 << "camera_matrix" << matrix << "distortion_coefficients"
        << distortion << "extrinsic_parameters" << cv::Mat::ones(13, 6, CV_64F);
    out.release();
    const CameraFile found = read_cameras(path(file), recognise_camera_file(path(file)));
    const Camera& camera = found.rig.cameras.at(0);
    EXPECT_EQ(camera.focal_px, Eigen::Vector2d(535.9, 536.1));
    EXPECT_EQ(camera.principal_px, Eigen::Vector2d(342.3 + 0.5, 235.6 + 0.5));
    EXPECT_EQ(camera.lens, Lens::brown5);
    EXPECT_EQ(camera.distortion, (LensCoefficients{-0.27, -0.04, 0.0018, -0.0003, 0.24}));
    EXPECT_THAT(found.notes, Contains(HasSubstr("'extrinsic_parameters'")));
  }
}

TEST_F(CameraFormats, ReadRosCameraInfo) {
  const CameraFile found = read("head.yaml", R"(image_width: 752
image_height: 480
camera_name: head
distortion_model: equidistant
camera_matrix: {rows: 3, cols: 3, data: [460.5, 0, 360.25, 0, 461, 240, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 4, data: [-0.01, 0.02, -0.03, 0.004]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
)");
  const Camera& camera = found.rig.cameras.at(0);
  EXPECT_EQ(camera.name, "head");
  EXPECT_EQ(camera.lens, Lens::fisheye);
  EXPECT_EQ(camera.principal_px, Eigen::Vector2d(360.75, 240.5));
}

TEST_F(CameraFormats, ReadAPairAsOpenCvsStereoSampleNamesIt) {
  const CameraFile found = read("stereo.yml", R"(%YAML:1.0
---
image_width: 640
image_height: 480
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 500., 240., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 510., 0., 321., 0., 510., 241., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 1.0e-01, 0., 0., 0., 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 0., 0., 1., 0., 1., 0., -1., 0., 0. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -1.2e+02, 3., 4. ]
)",
                                0.001);
  ASSERT_EQ(found.rig.cameras.size(), 2u);
  const Rigid3 second_from_first =
      found.rig.cameras[1].camera_from_world * found.rig.cameras[0].camera_from_world.inverse();
  const Eigen::Vector3d point = second_from_first * Eigen::Vector3d(1.0, 2.0, 3.0);
  EXPECT_LT((point - Eigen::Vector3d(3.0 - 0.12, 2.003, -1.0 + 0.004)).norm(), 1e-12);
  EXPECT_EQ(found.rig.cameras[1].lens, Lens::brown2);
}

TEST_F(CameraFormats, SayWhatIsWrongWithOpenCvFiles) {
  const std::string good =
      "image_width: 640\nimage_height: 480\n"
      "camera_matrix: {rows: 3, cols: 3, data: [5, 0, 3, 0, 5, 2, 0, 0, 1]}\n"
      "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n";
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    return complaint("a.yml", text.replace(text.find(from), from.size(), to), "opencv");
  };
  EXPECT_EQ(complaint("a.yml", good, "opencv"), "no complaint");
  EXPECT_THAT(with("image_width: 640\n", ""), HasSubstr("has no image_width"));
  EXPECT_THAT(with("640", "64.5"), HasSubstr("whole pixels"));
  EXPECT_THAT(with("[5, 0, 3", "[5, 1, 3"), HasSubstr("skew"));
  EXPECT_THAT(with("[5, 0, 3", "[5, .nan, 3"), HasSubstr("'camera_matrix': expected a matrix"));
  EXPECT_THAT(with("rows: 3", "rows: 4"), HasSubstr("'camera_matrix': expected a matrix"));
  EXPECT_THAT(with("rows: 3", "rows: 2147483647"), HasSubstr("'camera_matrix'"));
  EXPECT_THAT(with("cols: 5, data: [0, 0, 0, 0, 0]",
                   "cols: 12, data: [0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]"),
              HasSubstr("thin prism"));
  EXPECT_THAT(with("camera_matrix:", "camera_matrix: ["), HasSubstr("not valid YAML at line"));
  EXPECT_THAT(complaint("a.xml", "<opencv_storage><camera_matrix>", "opencv"),
              HasSubstr("not valid XML"));
  EXPECT_THAT(
      [&] {
        CameraRig three = some_rig(Lens::pinhole);
        three.cameras.push_back(some_camera("third", Lens::pinhole));
        write_cameras(path("three.yml"), {.rig = three}, *find_camera_format("opencv"));
      },
      ThrowsMessage<InvalidInput>(HasSubstr("--camera")));
}

// --- Kalibr

constexpr const char* chain = R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.294719325148, 0.0858646775033, -0.000238127700692, 7.49328134499e-05]
  distortion_model: radtan
  intrinsics: [461.487246372674, 460.111306927268, 356.399868350722, 231.157193867993]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [0.0, -1.0, 0.0, -0.11]
  - [1.0, 0.0, 0.0, 0.02]
  - [0.0, 0.0, 1.0, -0.003]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [-0.01, 0.02, -0.03, 0.004]
  distortion_model: equidistant
  intrinsics: [460.0, 459.0, 370.0, 250.0]
  resolution: [752, 480]
)";

TEST_F(CameraFormats, ReadAKalibrChain) {
  const CameraFile found = read("camchain.yaml", chain);
  EXPECT_THAT(found.notes, Contains(HasSubstr("'rostopic'")));
  ASSERT_EQ(found.rig.cameras.size(), 2u);
  const Camera &first = found.rig.cameras[0], &second = found.rig.cameras[1];
  EXPECT_EQ(first.name, "cam0");
  EXPECT_EQ(first.lens, Lens::brown5);
  EXPECT_EQ(second.lens, Lens::fisheye);
  // A point in the first camera's frame, by OpenCV in both.
  const std::vector<cv::Point3d> in_first{{0.3, -0.2, 1.5}};
  const std::vector<cv::Point3d> in_second{{0.2 - 0.11, 0.3 + 0.02, 1.5 - 0.003}};
  std::vector<cv::Point2d> seen_first, seen_second;
  const cv::Mat zero = cv::Mat::zeros(3, 1, CV_64F);
  const cv::Matx33d k1(461.487246372674, 0, 356.399868350722, 0, 460.111306927268, 231.157193867993,
                       0, 0, 1);
  const cv::Matx33d k2(460, 0, 370, 0, 459, 250, 0, 0, 1);
  cv::projectPoints(
      in_first, zero, zero, k1,
      cv::Vec4d(-0.294719325148, 0.0858646775033, -0.000238127700692, 7.49328134499e-05),
      seen_first);
  cv::fisheye::projectPoints(in_second, seen_second, zero, zero, k2,
                             cv::Vec4d(-0.01, 0.02, -0.03, 0.004));
  const Eigen::Vector3d world = first.camera_from_world.inverse() * Eigen::Vector3d(0.3, -0.2, 1.5);
  EXPECT_LT(
      (project_world(first, world) - Eigen::Vector2d(seen_first[0].x + 0.5, seen_first[0].y + 0.5))
          .norm(),
      exact_px);
  EXPECT_LT((project_world(second, world) -
             Eigen::Vector2d(seen_second[0].x + 0.5, seen_second[0].y + 0.5))
                .norm(),
            exact_px);
}

TEST_F(CameraFormats, KalibrKeepsPlacesRelativeToTheFirstAndSaysSo) {
  const CameraRig rig = some_rig(Lens::fisheye);
  const CameraFormat& kalibr = *find_camera_format("kalibr");
  EXPECT_THAT(write_cameras(path("camchain.yaml"), {.rig = rig}, kalibr),
              Contains(HasSubstr("no world")));
  const CameraRig found = read_cameras(path("camchain.yaml"), kalibr).rig;
  const auto link = [](const CameraRig& of) {
    return of.cameras[1].camera_from_world * of.cameras[0].camera_from_world.inverse();
  };
  const Rigid3 change = link(found) * link(rig).inverse();
  EXPECT_LT(rotation_vector_from_quaternion(change.rotation).norm(), 1e-14);
  EXPECT_LT(change.translation_m.norm(), 1e-14);
}

TEST_F(CameraFormats, KalibrHoldsBrown5WhereK3IsZero) {
  CameraRig rig = some_rig(Lens::brown5);
  for (Camera& camera : rig.cameras) camera.distortion[4] = 0.0;
  const CameraFormat& kalibr = *find_camera_format("kalibr");
  write_cameras(path("camchain.yaml"), {.rig = rig}, kalibr);
  EXPECT_EQ(read_cameras(path("camchain.yaml"), kalibr).rig.cameras[1].distortion,
            rig.cameras[1].distortion);
}

TEST_F(CameraFormats, SayWhatIsWrongWithKalibrFiles) {
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = chain;
    return complaint("a.yaml", text.replace(text.find(from), from.size(), to), "kalibr");
  };
  EXPECT_EQ(complaint("a.yaml", chain, "kalibr"), "no complaint");
  EXPECT_THAT(with("camera_model: pinhole", "camera_model: omni"),
              AllOf(HasSubstr("cam0: camera_model: expected pinhole"), HasSubstr("'omni'")));
  EXPECT_THAT(with("radtan", "fov"), HasSubstr("cam0: distortion_model: expected none, radtan"));
  EXPECT_THAT(with("cam1:", "cam2:"), HasSubstr("without a gap"));
  EXPECT_THAT(with("- [0.0, 0.0, 1.0, -0.003]", "- [0.0, 0.0, 1.5, -0.003]"),
              HasSubstr("'cam1': the rotation is not a rotation matrix"));
  EXPECT_THAT(with("  - [0.0, 0.0, 0.0, 1.0]\n", ""),
              HasSubstr("cam1: T_cn_cnm1: expected 16 finite numbers"));
  EXPECT_THAT(with("resolution: [752, 480]", "resolution: [752]"),
              HasSubstr("cam0: resolution: expected 2 finite numbers"));
  EXPECT_THAT(complaint("a.yaml", "- 1\n- 2\n", "kalibr"), HasSubstr("has no cam0"));
}

// --- TOML

constexpr const char* anipose = R"([cam_0]
name = "A"
size = [ 1280, 1024,]
matrix = [ [ 1500.5, 0.0, 640.25,], [ 0.0, 1500.5, 512.5,], [ 0.0, 0.0, 1.0,],]
distortions = [ -0.1, 0.0, 0.0, 0.0, 0.0,]
rotation = [ 0.0, 0.0, 1.5707963267948966,]
translation = [ 10.0, -20.0, 1500.0,]

[metadata]
adjusted = false
error = 0.5
)";

TEST_F(CameraFormats, ReadAniposelibInMillimetres) {
  const CameraFile found = read("calibration.toml", anipose, 0.001);
  const Camera& camera = found.rig.cameras.at(0);
  EXPECT_EQ(camera.name, "A");
  // x of the world is the camera's y.
  const Eigen::Vector3d seen = camera.camera_from_world * Eigen::Vector3d(0.3, 0.0, 0.0);
  EXPECT_LT((seen - Eigen::Vector3d(0.01, 0.28, 1.5)).norm(), 1e-15);
  const double y = 0.28 / 1.5, x = 0.01 / 1.5, radial = 1.0 - 0.1 * (x * x + y * y);
  EXPECT_LT((project_world(camera, {0.3, 0.0, 0.0}) -
             Eigen::Vector2d(1500.5 * x * radial + 640.75, 1500.5 * y * radial + 513.0))
                .norm(),
            exact_px);
}

TEST_F(CameraFormats, ReadCaliscopesOlderAndNewerTables) {
  // config.toml of earlier versions, and camera_array.toml with vectors instead of matrices.
  const std::string camera =
      "size = [1280, 720]\nmatrix = [[900.5, 0.0, 618.25], [0.0, 907.0, 394.0], [0.0, 0.0, 1.0]]\n"
      "distortions = [-0.3, 0.05, -0.004, 0.004, 0.07]\ntranslation = [0.25, -0.5, 1.0]\n";
  const CameraFile older =
      read("config.toml", "[cam_3]\ncam_id = 3\n" + camera +
                              "rotation = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]\n" +
                              "[charuco]\ncolumns = 4\n");
  const CameraFile newer = read(
      "camera_array.toml", "[cameras.3]\ncam_id = 3\nfisheye = false\n" + camera +
                               "rotation = [0, " + std::to_string(0.0) + " , 0]\nerror = 0.3\n");
  EXPECT_EQ(older.rig.cameras.at(0).name, "cam_3");
  EXPECT_EQ(newer.rig.cameras.at(0).name, "cam_3");
  EXPECT_LT((older.rig.cameras[0].camera_from_world * Eigen::Vector3d(1, 2, 3) -
             Eigen::Vector3d(3.25, 1.5, 0.0))
                .norm(),
            1e-15);
  EXPECT_EQ(newer.rig.cameras[0].camera_from_world * Eigen::Vector3d(1, 2, 3),
            Eigen::Vector3d(1.25, 1.5, 4.0));
  EXPECT_THAT(newer.notes, Contains(HasSubstr("'error'")));
  // Both are in metres: another unit would be a mistake.
  EXPECT_THAT([&] { read_cameras(path("config.toml"), *find_camera_format("caliscope"), 0.01); },
              ThrowsMessage<InvalidInput>(HasSubstr("leave the unit away")));
}

TEST_F(CameraFormats, SayWhatIsWrongWithTomlFiles) {
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = anipose;
    return complaint("a.toml", text.replace(text.find(from), from.size(), to), "aniposelib");
  };
  EXPECT_EQ(complaint("a.toml", anipose, "aniposelib"), "no complaint");
  EXPECT_THAT(with("size = [ 1280, 1024,]", "size = [ 1280 ]"),
              HasSubstr("['cam_0'] size: expected 2 numbers"));
  EXPECT_THAT(with("[ -0.1,", "[ nan,"), HasSubstr("distortions: expected finite numbers"));
  EXPECT_THAT(with("[ -0.1,", "[ '1',"), HasSubstr("distortions: expected finite numbers"));
  EXPECT_THAT(with("rotation =", "rotate ="), HasSubstr("rotation: expected both"));
  EXPECT_THAT(with("1.5707963267948966", "1.5, 2"), HasSubstr("rotation vector of 3"));
  EXPECT_THAT(with("matrix", "matrices"), HasSubstr("has no camera"));
  EXPECT_THAT(with("size", "size = 1\nsize"), HasSubstr("not valid TOML at line 4"));
  EXPECT_THAT(with("[cam_0]", "# é\n[cam_О]"), HasSubstr("line 2: letters beyond ASCII"));
  for (const char* name : {R"("é\" О")", "\"\"\"é\" \n О\\\"\"\"\"\"", "'é'", "'''é\n'О'''''"}) {
    EXPECT_EQ(with("\"A\"", std::string(name) + " # О"), "no complaint") << name;
  }
  std::string two = anipose;
  two += "[cam_1]\n" + two.substr(8, two.find("rotation") - 8);
  EXPECT_THAT(complaint("a.toml", two, "aniposelib"), HasSubstr("without a pose"));
  std::string same = anipose;
  same += "[cam_1]\n" + same.substr(8, same.find("[metadata]") - 8);
  EXPECT_THAT(complaint("a.toml", same, "aniposelib"), HasSubstr("two cameras are called 'A'"));
}

// --- Qualisys

std::string qca(const std::string& sensor, const std::string& field) {
  return "<calibration type=\"regular\"><cameras><camera active=\"1\" serial=\"26580\" "
         "model=\"Miqus Video\" viewrotation=\"0\">"
         "<fov_video " +
         field + "/><fov_video_max left=\"0\" top=\"0\" right=\"1919\" bottom=\"1087\"/>" +
         "<transform x=\"1000\" y=\"-2000\" z=\"3000\" r11=\"1\" r12=\"0\" r13=\"0\" r21=\"0\" "
         "r22=\"0\" r23=\"1\" r31=\"0\" r32=\"-1\" r33=\"0\"/>" +
         "<intrinsic focallength=\"9.27\" sensorMinU=\"0.0\" sensorMinV=\"0.0\" " + sensor +
         " skew=\"0\" radialDistortion1=\"-0.045\" radialDistortion2=\"0.14\" "
         "radialDistortion3=\"0\" tangentalDistortion1=\"0.0006\" "
         "tangentalDistortion2=\"-0.0004\"/></camera></cameras></calibration>";
}
const std::string sensor_64ths =
    "sensorMaxU=\"122879.0\" sensorMaxV=\"69631.0\" focalLengthU=\"107872\" "
    "focalLengthV=\"107880\" centerPointU=\"60827.5\" centerPointV=\"32684.0\"";
const std::string whole_field = "left=\"0\" top=\"0\" right=\"1919\" bottom=\"1087\"";

TEST_F(CameraFormats, ReadQualisysIn64thsAndMillimetres) {
  const CameraFile found = read("lab.qca.txt", qca(sensor_64ths, whole_field));
  const Camera& camera = found.rig.cameras.at(0);
  EXPECT_EQ(camera.name, "26580");
  EXPECT_EQ(camera.width, 1920);
  EXPECT_EQ(camera.height, 1088);
  EXPECT_EQ(camera.focal_px, Eigen::Vector2d(107872.0 / 64.0, 107880.0 / 64.0));
  EXPECT_EQ(camera.principal_px, Eigen::Vector2d(60827.5 / 64.0, 32684.0 / 64.0));
  EXPECT_EQ(camera.distortion, (LensCoefficients{-0.045, 0.14, 0.0006, -0.0004}));
  // It stands at (1, -2, 3), its back to -y: it looks along y, with z of the world up.
  const Eigen::Vector3d ahead = camera.camera_from_world * Eigen::Vector3d(1.0, 2.0, 3.0);
  EXPECT_LT((ahead - Eigen::Vector3d(0, 0, 4)).norm(), 1e-14);
  EXPECT_GT(project_world(camera, {1.5, 2.0, 3.0}).x(), camera.principal_px.x());
  EXPECT_LT(project_world(camera, {1.0, 2.0, 3.5}).y(), camera.principal_px.y());
}

TEST_F(CameraFormats, ReadAPartOfAQualisysSensor) {
  const CameraFile found = read(
      "lab.qca.txt", qca(sensor_64ths, "left=\"100\" top=\"20\" right=\"1099\" bottom=\"619\""));
  EXPECT_EQ(found.rig.cameras[0].width, 1000);
  EXPECT_EQ(found.rig.cameras[0].height, 600);
  EXPECT_EQ(found.rig.cameras[0].principal_px,
            Eigen::Vector2d(60827.5 / 64.0 - 100.0, 32684.0 / 64.0 - 20.0));
}

TEST_F(CameraFormats, SayWhatIsWrongWithQualisysFiles) {
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = qca(sensor_64ths, whole_field);
    return complaint("a.qca.txt", text.replace(text.find(from), from.size(), to), "qualisys");
  };
  EXPECT_EQ(with("26580", "26580"), "no complaint");
  EXPECT_THAT(with("122879.0", "100000"), HasSubstr("the sensor's range U"));
  EXPECT_THAT(with("skew=\"0\"", "skew=\"1\""), HasSubstr("camera '26580': <intrinsic>: skew"));
  EXPECT_THAT(with("x=\"1000\"", "x=\"\""), HasSubstr("<transform>: x: expected a finite number"));
  EXPECT_THAT(with("fov_video ", "fov_videos "), HasSubstr("<fov_video> is missing"));
  EXPECT_THAT(with("serial=\"26580\"", ""), HasSubstr("has no serial"));
  EXPECT_THAT(with("r11=\"1\"", "r11=\"-1\""), HasSubstr("not a rotation matrix"));
  EXPECT_THAT(with("<cameras>", ""), HasSubstr("not valid XML"));
  EXPECT_THAT(complaint("a.qca.txt", "<calibration/>", "qualisys"), HasSubstr("has no <camera>"));
}

// --- rigs

TEST_F(CameraFormats, RigsKeepEveryBit) {
  CameraRig rig;
  for (const Lens lens : all_lenses) {
    rig.cameras.push_back(some_camera("c" + std::string(lens_name(lens)), lens, 0.1));
  }
  write_rig(path("rig.json"), rig);
  const std::string first = read_text(path("rig.json"));
  write_rig(path("rig.json"), read_rig(path("rig.json")));
  EXPECT_EQ(read_text(path("rig.json")), first);
  EXPECT_EQ(read_rig(path("rig.json")).cameras[3].camera_from_world.rotation.coeffs(),
            rig.cameras[3].camera_from_world.rotation.coeffs());
}

TEST_F(CameraFormats, ARigOfOneIsACameraFile) {
  const Camera camera = some_camera("only", Lens::brown8);
  write_cameras(path("c.json"), {.rig = {{camera}}}, *find_camera_format("semblance"));
  EXPECT_EQ(read_camera(path("c.json")).distortion, camera.distortion);
  EXPECT_EQ(read_rig(path("c.json")).cameras.at(0).name, "only");
}

TEST_F(CameraFormats, RigsListAllProblemsOfAllCameras) {
  write_text(path("bad.json"), R"({"schema":"semblance.rig/1","x":1,"cameras":[
    {"schema":"semblance.camera/1","width":0,"height":5,"focal_px":[1,1],"principal_px":[1,1]},
    {"schema":"semblance.camera/1","width":5,"height":5,"focal_px":[1],"principal_px":[1,1],
     "camera_from_world":{"rotation_wxyz":[1,0,0,0]}}, 7]})");
  EXPECT_THAT([&] { read_rig(path("bad.json")); },
              ThrowsMessage<InvalidInput>(AllOf(
                  HasSubstr("bad.json: "), HasSubstr("cameras[0].width: expected a whole number"),
                  HasSubstr("cameras[1].focal_px: expected 2"),
                  HasSubstr("cameras[1].camera_from_world.translation_m: is missing"),
                  HasSubstr("cameras[2]: expected an object"), HasSubstr("unknown key 'x'"))));
  CameraRig twins = some_rig(Lens::pinhole);
  twins.cameras[1].name = twins.cameras[0].name;
  EXPECT_THAT([&] { write_rig(path("twins.json"), twins); },
              ThrowsMessage<InvalidInput>(HasSubstr("two cameras are called 'cam_0'")));
  EXPECT_FALSE(std::filesystem::exists(path("twins.json")));
  EXPECT_THAT([&] { write_rig(path("none.json"), {}); },
              ThrowsMessage<InvalidInput>(HasSubstr("holds no camera")));
}

}  // namespace
}  // namespace semblance
