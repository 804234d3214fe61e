#include "semblance/io/marker_points.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string error_of(const std::string& text) {
  try {
    marker_points_from_json(nlohmann::json::parse(text), "file.json");
  } catch (const InvalidInput& error) {
    return error.what();
  }
  return "no error";
}

TEST(MarkerPoints, ComeBackAsWritten) {
  const testing::TemporaryFolder folder;
  const std::string path = (folder.path() / "points.json").string();
  const std::vector<MarkerPoint> points{
      {"nose", {0.1, -0.2, 1.0 / 3.0}, 0.004, Eigen::Vector3d(0.6, 0.0, 0.8), {}},
      {"chin", {0.0, 0.0, 0.0}, {}, {}, Eigen::Vector3d(1e-4, 2e-4, 3e-4)}};
  write_marker_points(path, points);
  const std::vector<MarkerPoint> read = read_marker_points(path);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].name, "nose");
  EXPECT_EQ(read[0].position_m, points[0].position_m);
  EXPECT_EQ(read[0].radius_m, points[0].radius_m);
  EXPECT_LT((*read[0].normal - *points[0].normal).norm(), 1e-15);
  EXPECT_FALSE(read[0].sigma_m.has_value());
  EXPECT_FALSE(read[1].normal.has_value());
  EXPECT_EQ(*read[1].sigma_m, *points[1].sigma_m);
}

TEST(MarkerPoints, BadEntriesAreNamed) {
  EXPECT_THAT(error_of(R"({"points": []})"), HasSubstr("semblance.marker_points/1"));
  const std::string head = R"({"schema": "semblance.marker_points/1", "points": )";
  EXPECT_THAT(error_of(head + "7}"), HasSubstr("list of objects"));
  EXPECT_THAT(error_of(head + R"([{"name": "a"}]})"),
              AllOf(HasSubstr("file.json"), HasSubstr("points[0]"), HasSubstr("position_m")));
  EXPECT_THAT(error_of(head + R"([{"name": "a", "position_m": [0, 0, 0], "normal": [0, 0, 0]}]})"),
              HasSubstr("not zero"));
  EXPECT_THAT(error_of(head + R"([{"name": "a", "position_m": [0, 0, 0], "radius_m": -1}]})"),
              HasSubstr("radius_m"));
  EXPECT_THAT(error_of(head + R"([{"name": "a", "position_m": [0, 0, 0]},
                                  {"name": "a", "position_m": [1, 0, 0]}]})"),
              AllOf(HasSubstr("points[1]"), HasSubstr("another point")));
  EXPECT_THAT(error_of(head + R"([{"name": "a", "position_m": [0, 0, 1e9]}]})"),
              HasSubstr("at most"));
}

}  // namespace
}  // namespace semblance
