#include "semblance/io/visemes.h"

#include <gmock/gmock.h>

#include "files.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

Viseme viseme(const std::string& name, double shift_m) {
  Viseme v{name, {}};
  for (int i = 0; i < Viseme::marker_count; ++i) {
    v.markers_m.emplace_back(-0.02 + i / 300.0, -0.07 / (1 + i), shift_m + 0.001 * i);
  }
  return v;
}

TEST(Visemes, SurviveARoundTripToTheLastBit) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "visemes.json";
  const std::vector<Viseme> visemes{viseme("a", 0.0), viseme("o \"round\"", 1.0 / 3.0)};
  write_visemes(path, visemes);
  const std::vector<Viseme> found = read_visemes(path);
  ASSERT_EQ(found.size(), visemes.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].name, visemes[i].name);
    EXPECT_EQ(found[i].markers_m, visemes[i].markers_m);
  }
}

void expect_message(const std::string& content, const std::string& message) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "visemes.json";
  write_text(path, content);
  EXPECT_THAT([&] { read_visemes(path); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr(path), HasSubstr(message))));
}

std::string file_with(const std::string& visemes) {
  return R"({"schema": "semblance.visemes/1", "visemes": [)" + visemes + "]}";
}

std::string entry(const std::string& name, const std::string& first, int count) {
  std::string markers = first;
  for (int i = 1; i < count; ++i) markers += ",[0.01,0,0]";
  return R"({"name": ")" + name + R"(", "markers_m": [)" + markers + "]}";
}

TEST(Visemes, RejectWithAMessage) {
  const std::string corner = "[-0.02,0,0]", good = entry("a", corner, 16);
  expect_message("", "not valid JSON");
  expect_message("[]", "keys 'schema' (\"semblance.visemes/1\") and 'visemes'");
  expect_message(R"({"schema": "semblance.visemes/2", "visemes": []})", "semblance.visemes/1");
  expect_message(file_with(""), "has 0 entries");
  expect_message(file_with("3"), "viseme 0 (from 0): an object with the keys");
  expect_message(file_with(entry("", corner, 16)), "1 to 64 bytes");
  expect_message(file_with(entry("a", corner, 15)), "15 markers; 16 were expected");
  expect_message(file_with(entry("a", "[1,2]", 16)), "marker 0: three coordinates");
  expect_message(file_with(entry("a", "[null,0,0]", 16)), "marker 0: a coordinate is not a number");
  expect_message(file_with(entry("a", "[-20,0,0]", 16)), "divide millimetres by 1000");
  expect_message(file_with(entry("a", "[0.02,0,0]", 16)), "face's own right");
  expect_message(file_with(good + "," + good), "viseme 1 (from 0): the name 'a' is given twice");
}

}  // namespace
}  // namespace semblance
