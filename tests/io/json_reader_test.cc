#include "semblance/io/json_reader.h"

#include <gmock/gmock.h>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using ::testing::ThrowsMessage;
using Json = nlohmann::json;

TEST(JsonReader, GathersAllProblemsOfAllLevels) {
  const Json json = Json::parse(R"({"a":1.5,"b":[1,"2"],"c":{"d":[{"e":7},3],"x":0},"f":"yes"})");
  JsonReader in(json, "file.json");
  int a = 4;
  bool f = false;
  Eigen::Vector2d b(5, 6);
  in.number("a", a, 0, 10);
  in.vector("b", b);
  in.group("c", [&](JsonReader& inner) {
    inner.required("missing");
    inner.list("d", [&](JsonReader& item, std::size_t) {
      int e = 0;
      item.number("e", e, 0, 5);
    });
  });
  in.flag("f", f);
  EXPECT_THAT([&] { in.finish(); },
              ThrowsMessage<InvalidInput>(AllOf(
                  StartsWith("file.json: a: expected a whole number from 0 to 10; "),
                  HasSubstr("; b: expected 2 finite numbers"), HasSubstr("; c.missing: is missing"),
                  HasSubstr("; c.d[0].e: expected a whole number from 0 to 5, not 7"),
                  HasSubstr("; c.d[1]: expected an object"),
                  HasSubstr("; c: unknown key 'x'; known are d, missing"),
                  HasSubstr("; f: expected true or false"))));
  // What could not be read is as it was.
  EXPECT_EQ(a, 4);
  EXPECT_EQ(b, Eigen::Vector2d(5, 6));
}

TEST(JsonReader, FailThrowsAtOnceWithWhatWasFoundBefore) {
  const Json json = Json::parse(R"({"a":"x","kind":"cube"})");
  JsonReader in(json, "file.json");
  double a = 0.0;
  in.check();  // nothing wrong yet
  in.number("a", a, 0, 1);
  EXPECT_THAT([&] { in.fail("kind", "line or spline"); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr("a: expected a number"),
                                                HasSubstr("kind: expected line or spline"))));
}

TEST(JsonReader, DoesNotFillTheScreen) {
  Json json;
  for (int i = 0; i < 100; ++i) json[std::to_string(i)] = i;
  JsonReader in(json, "file.json");
  EXPECT_THAT([&] { in.finish(); }, ThrowsMessage<InvalidInput>(HasSubstr("and 80 more")));
}

}  // namespace
}  // namespace semblance
