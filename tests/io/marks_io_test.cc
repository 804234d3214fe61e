#include "semblance/io/marks_io.h"

#include <gmock/gmock.h>

#include "files.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class Marks : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  std::string file_of(const std::string& text) const {
    testing::write_text(path("marks.json"), text);
    return path("marks.json");
  }

 private:
  testing::TemporaryFolder folder_;
};

TEST_F(Marks, ReadsAWholeFile) {
  const MarksFile marks = read_marks(file_of(R"({"format":"semblance.marks/1",
    "points":{"a":[0,1,2],"d":[3,4,5]},
    "photos":[{"file":"one.jpg","marks":{"a":[10.5,20],"b":[30,44.25]}},
              {"file":"/far/two.jpg","marks":{"c":[1,2]}}],
    "lengths":[{"from":"a","to":"b","metres":0.3,"sigma_m":0.002},
               {"from":"c","to":"d","metres":2}],
    "axes":{"origin":"a","x":"b","y":"c"}})"));
  EXPECT_THAT(marks.names(), ElementsAre("a", "b", "c", "d"));
  ASSERT_EQ(marks.photos.size(), 2U);
  EXPECT_EQ(marks.photos[0].file, path("one.jpg"));
  EXPECT_EQ(marks.photos[1].file, "/far/two.jpg");
  EXPECT_EQ(marks.photos[0].marks_px.at("b"), Eigen::Vector2d(30, 44.25));
  EXPECT_EQ(marks.points_m.at("d"), Eigen::Vector3d(3, 4, 5));
  ASSERT_EQ(marks.lengths.size(), 2U);
  EXPECT_EQ(marks.lengths[0].sigma_m, 0.002);
  EXPECT_EQ(marks.lengths[1].sigma_m, 0.002);  // a thousandth
  EXPECT_EQ(marks.axes->y, "c");
}

TEST_F(Marks, ComeBackAsTheyWereWritten) {
  MarksFile marks;
  marks.photos = {{path("one.jpg"), {{"\u00e4 b", {1.0 / 3.0, 2.5}}}}, {"/far/two.jpg", {}}};
  marks.photos[1].camera = "left";
  marks.points_m["c"] = {1.0 / 7.0, -2.0, 1e-9};
  marks.points_sigma_m = 2e-4;
  marks.lengths = {{"c", "\u00e4 b", 0.1, 1e-5}};
  write_marks(path("marks.json"), marks);
  const MarksFile back = read_marks(path("marks.json"));
  EXPECT_EQ(back.photos[0].file, marks.photos[0].file);
  EXPECT_EQ(std::filesystem::path(back.photos[1].file).lexically_normal(), "/far/two.jpg");
  EXPECT_EQ(back.photos[0].marks_px, marks.photos[0].marks_px);
  EXPECT_EQ(back.points_m, marks.points_m);
  EXPECT_EQ(back.lengths[0].sigma_m, 1e-5);
  EXPECT_FALSE(back.axes);
  EXPECT_EQ(back.photos[0].camera, "");
  EXPECT_EQ(back.photos[1].camera, "left");
  EXPECT_EQ(back.points_sigma_m, 2e-4);
}

TEST_F(Marks, HaveOneFrame) {
  const std::string two = file_of(R"({"format":"semblance.marks/1","points_sigma_m":0.01,
    "points":{"a":[0,1,2],"b":[3,4,5],"c":[3,4,6]},"photos":[],
    "axes":{"origin":"a","x":"b","y":"c"}})");
  try {
    read_marks(two);
    FAIL() << "two frames were taken";
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("are a frame already"));
  }
}

TEST_F(Marks, SayEverythingThatIsWrong) {
  const std::string bad = file_of(R"({"format":"semblance.marks/1",
    "photos":[{"file":"a.jpg","marks":{"a":[10.5]}},{"file":"a.jpg","marks":{"b":[1,2]}}],
    "lengths":[{"from":"a","to":"a","metres":-1}],"axes":{"origin":"a","x":"b","y":"x"},
    "scale":3})");
  EXPECT_THAT([&] { read_marks(bad); },
              ThrowsMessage<InvalidInput>(AllOf(
                  HasSubstr("marks.json: "), HasSubstr("photos[0].marks.a: expected 2 finite"),
                  HasSubstr("photos[1].file: is the same"), HasSubstr("lengths[0].to: expected"),
                  HasSubstr("lengths[0].metres: expected a number"),
                  HasSubstr("axes.y: expected the name"), HasSubstr("unknown key 'scale'"))));
  EXPECT_THAT([&] { read_marks(file_of(R"({"points":{}})")); },
              ThrowsMessage<InvalidInput>(HasSubstr("format: is missing")));
  EXPECT_THAT([&] { read_marks(file_of(R"({"format":"semblance.marks/1"})")); },
              ThrowsMessage<InvalidInput>(HasSubstr("photos: is missing")));
}

}  // namespace
}  // namespace semblance
