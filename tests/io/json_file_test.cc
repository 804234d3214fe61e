#include "semblance/io/json_file.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(Json, NamesThePlaceOfAnError) {
  EXPECT_THAT([] { parse_json("{\n \"a\": 1,\n \"b\": oops\n}", "file.json"); },
              ThrowsMessage<InvalidInput>(HasSubstr("file.json: is not valid JSON at line 3")));
}

TEST(Json, RejectsDeepNesting) {
  EXPECT_NO_THROW(parse_json(std::string(60, '[') + std::string(60, ']'), "file"));
  EXPECT_THAT([] { parse_json(std::string(1000000, '['), "file"); },
              ThrowsMessage<InvalidInput>(HasSubstr("64 levels")));
  EXPECT_NO_THROW(parse_json("\"" + std::string(100, '[') + "\"", "file")) << "within a string";
}

TEST(Json, RejectsRepeatedKeysOfOneObjectOnly) {
  EXPECT_THAT([] { parse_json(R"({"a":{"b":1,"b":2}})", "file"); },
              ThrowsMessage<InvalidInput>(HasSubstr("'b' is given twice")));
  EXPECT_NO_THROW(parse_json(R"({"a":{"b":1},"c":{"b":2}})", "file"));
}

}  // namespace
}  // namespace semblance
