// `semblance fabric`: what it writes, and what it answers to files that cannot be used.
#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "program.h"
#include "support.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class FabricCommand : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }
  ProgramResult test(const std::string& file, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"fabric", "test", file, "-o", path("out")});
    return run_program(more);
  }
  void expect_refused(const ProgramResult& result, const std::string& message) const {
    EXPECT_EQ(result.exit_code, 3) << result.output;
    EXPECT_THAT(result.output, HasSubstr(message));
    EXPECT_FALSE(fs::exists(path("out")));
    EXPECT_FALSE(fs::exists(path("summary.json")));
  }

 private:
  TemporaryFolder folder_;
};

const char* const two_fabrics =
    "fabric,EMT_pct,LT,RT_pct,G_gf_cm_deg,2HG_gf_cm,2HG5_gf_cm,B_gfcm2_cm,2HB_gfcm_cm\n"
    "shirting,5,0.7,60,1.1,1.5,3,0.08,0.03\nlining,6,0.8,70,0.3,0.2,0.4,0.02,0.01\n";

TEST_F(FabricCommand, TestsAFabricOfMany) {
  const std::string file = write("many.csv", two_fabrics);
  const ProgramResult result = test(file, {"--name", "lining", "--json", path("summary.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, AllOf(HasSubstr("2HG5"), HasSubstr("assumed:")));
  const auto summary = nlohmann::json::parse(file_bytes(path("summary.json")));
  EXPECT_EQ(summary["fabric"], "lining");
  EXPECT_EQ(summary["figures"].size(), 15u);
  EXPECT_LT(summary["largest_residual_pct"].get<double>(), 0.1);
  EXPECT_THAT(file_bytes(path("out/loops.svg")), HasSubstr("KES tests: lining"));
  // What it writes can be read again.
  for (const char* name : {"out/loops.csv", "out/fabric.json"}) {
    const ProgramResult again = run_program(
        {"fabric", "test", path(name), "-o", path("again"), "--json", path("again.json")});
    ASSERT_EQ(again.exit_code, 0) << again.output;
    const auto second = nlohmann::json::parse(file_bytes(path("again.json")));
    EXPECT_LT(second["largest_residual_pct"].get<double>(), 0.5) << name;
  }
}

TEST_F(FabricCommand, SameInputSameBytes) {
  const std::string file = write("many.csv", two_fabrics) + ":shirting";
  ASSERT_EQ(test(file).exit_code, 0);
  const std::string first = file_bytes(path("out/loops.svg"));
  ASSERT_EQ(test(file).exit_code, 0);
  EXPECT_EQ(file_bytes(path("out/loops.svg")), first);
}

TEST_F(FabricCommand, ShowsBothUnitsAndWhatItAssumed) {
  const ProgramResult result =
      run_program({"fabric", "show", write("many.csv", two_fabrics) + ":shirting"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, AllOf(HasSubstr("gf cm2/cm"), HasSubstr("N/m per rad"),
                                   HasSubstr("area density not given")));
}

TEST_F(FabricCommand, RefusesBadFilesAndWritesNothing) {
  const std::vector<std::string> summary{"--json", path("summary.json")};
  const std::string many = write("many.csv", two_fabrics);
  expect_refused(test(many, summary), "holds 2 fabrics: shirting, lining");
  expect_refused(test(many + ":silk", summary), "no fabric 'silk'");
  expect_refused(test(path("absent.json"), summary), "absent.json");
  expect_refused(test(write("a.json", "{"), summary), "a.json");
  expect_refused(test(write("a.csv", "fabric,EMT_pct\nx,five\n"), summary), "a.csv:2");
  expect_refused(test(write("a.json", R"({"schema": "semblance.fabric/1", "units": "si",
                                          "area_density": 120})"),
                      summary),
                 "g/m2?");
}

TEST_F(FabricCommand, WrongUsage) {
  EXPECT_EQ(run_program({"fabric"}).exit_code, 2);
  EXPECT_EQ(run_program({"fabric", "test", "a.json"}).exit_code, 2);
}

}  // namespace
}  // namespace semblance::testing
