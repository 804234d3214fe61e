#include "semblance/cloth/sheet_specimen.h"

#include <gmock/gmock.h>

#include "semblance/cloth/fabric_io.h"
#include "sheets.h"
#include "support.h"

namespace semblance {
namespace {

/// Every figure of every fabric, given and as a simulated sheet gives it.
TEST(SheetSpecimens, ReproduceTheFiguresOfRealFabrics) {
  SEMBLANCE_NEED_DATA("cloth/kes_fabrics.csv");
  const std::string file = testing::data_path("cloth/kes_fabrics.csv").string();
  for (const char* name : {"denim A", "denim B", "denim C", "denim D", "denim E", "denim F",
                           "cotton broad", "wool tropical", "polyester faille"}) {
    const FabricRecord record = read_fabric_record(file, name);
    const KesLoops loops = run_kes_tests(sheet_specimens(record.fabric));
    int compared = 0;
    for (const FigureComparison& figure : compare_figures(record.given, figures_of(loops))) {
      const auto residual = figure.residual_pct();
      if (!residual) continue;
      EXPECT_LT(std::abs(*residual), 3.0) << name << " " << figure.name.symbol;
      ++compared;
    }
    EXPECT_GE(compared, 2) << name;
  }
}

}  // namespace
}  // namespace semblance
