#include "semblance/io/points.h"

#include <gmock/gmock.h>

#include "files.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

TEST(Points, PtsFilesCountPixelCentresFromOne) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "face.pts";
  write_text(path, "version: 1\r\nn_points:  2\r\n{\r\n1 1\r\n336.820955 240.864510\r\n}\r\n");
  const auto points = read_points(path);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0], Eigen::Vector2d(0.5, 0.5));  // the centre of the first pixel
  EXPECT_NEAR(points[1].x(), 336.320955, 1e-9);
}

TEST(Points, JsonIsInOurPixels) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "face.json";
  write_text(path, R"({"points":[[0.5,0.5],[-3,7.25]]})");
  EXPECT_THAT(read_points(path),
              ::testing::ElementsAre(Eigen::Vector2d(0.5, 0.5), Eigen::Vector2d(-3, 7.25)));
}

TEST(Points, SurviveARoundTrip) {
  const TemporaryFolder folder;
  const std::vector<Eigen::Vector2d> points = {{1.0 / 3.0, 100.25}, {-2.0, 0.0}};
  for (const char* name : {"a.pts", "a.json"}) {
    write_points(folder.path() / name, points);
    const auto found = read_points(folder.path() / name);
    ASSERT_EQ(found.size(), 2u);
    for (int i = 0; i < 2; ++i) EXPECT_LT((found[i] - points[i]).norm(), 1e-12) << name;
  }
}

struct BadPoints {
  const char* name;
  const char* file;
  const char* content;
  const char* message;
};

class PointsReject : public ::testing::TestWithParam<BadPoints> {};

TEST_P(PointsReject, WithAMessage) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / GetParam().file;
  write_text(path, GetParam().content);
  EXPECT_THAT([&] { read_points(path); }, ThrowsMessage<InvalidInput>(::testing::AllOf(
                                              HasSubstr(path), HasSubstr(GetParam().message))));
}

INSTANTIATE_TEST_SUITE_P(
    All, PointsReject,
    ::testing::Values(
        BadPoints{"Count", "a.pts", "version: 1\nn_points: 3\n{\n1 2\n}\n",
                  "1 points, but 'n_points' says 3"},
        BadPoints{"Word", "a.pts", "n_points: 1\n{\n1 two\n}\n", "a.pts:3: '1 two' is not a point"},
        BadPoints{"Nan", "a.pts", "n_points: 1\n{\nnan 2\n}\n", "is not a point"},
        BadPoints{"Three", "a.pts", "n_points: 1\n{\n1 2 3\n}\n", "is not a point"},
        BadPoints{"Open", "a.pts", "n_points: 1\n{\n1 2\n", "before the closing brace"},
        BadPoints{"Empty", "a.pts", "", "before the closing brace"},
        BadPoints{"Huge", "a.pts", "n_points: 99999999999\n{\n}\n", "from 1 to 100000"},
        BadPoints{"Text", "a.pts", "hello\n", "was not expected"},
        BadPoints{"Key", "a.json", R"({"landmarks":[]})", "the one key 'points'"},
        BadPoints{"None", "a.json", R"({"points":[]})", "has 0 entries"},
        BadPoints{"Pair", "a.json", R"({"points":[[1,2],[3]]})", "entry 1 of 'points'"},
        BadPoints{"Null", "a.json", R"({"points":[[1,null]]})", "entry 0 of 'points'"},
        BadPoints{"Kind", "a.txt", "1 2", ".pts or .json"}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace semblance
