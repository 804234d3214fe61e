#include "semblance/cloth/loop_drawing.h"

#include <gmock/gmock.h>

#include "plausible_fabric.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

LoopDrawing drawing_of(const Fabric& fabric) {
  LoopDrawing drawing;
  drawing.title = "twill <2>";
  drawing.given = steady_loops(fabric);
  drawing.tested = run_kes_tests(material_points(fabric), {40});
  drawing.figures = compare_figures(figures_of(drawing.given), figures_of(drawing.tested));
  return drawing;
}

int count(const std::string& text, const std::string& part) {
  int found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++found;
  }
  return found;
}

TEST(LoopDrawing, HasAPanelPerModeAndARowPerFigure) {
  const std::string svg = loops_svg(drawing_of(testing::plausible_fabric()));
  EXPECT_THAT(svg, AllOf(HasSubstr("twill &lt;2&gt;"), HasSubstr("Tension along weft"),
                         HasSubstr("Shear"), HasSubstr("Bending along warp"), HasSubstr("(gf/cm)"),
                         HasSubstr("2HG5"), Not(HasSubstr("nan")), Not(HasSubstr("inf"))));
  EXPECT_EQ(count(svg, "stroke-width='6' stroke-linejoin"), 5);
  EXPECT_EQ(count(svg, "stroke-width='1.6' stroke-linejoin"), 5);
  EXPECT_EQ(count(svg, "not given: assumed"), 0);
}

TEST(LoopDrawing, SaysWhatWasNotGivenOrNotTested) {
  LoopDrawing drawing = drawing_of(testing::plausible_fabric());
  drawing.given.shear.clear();
  drawing.given.bending[weft].clear();
  drawing.tested.bending[weft].clear();
  const std::string svg = loops_svg(drawing);
  EXPECT_EQ(count(svg, "not given: assumed"), 1);
  EXPECT_EQ(count(svg, "not tested"), 1);
}

TEST(LoopDrawing, SameDrawingSameText) {
  const Fabric fabric = testing::plausible_fabric();
  EXPECT_EQ(loops_svg(drawing_of(fabric)), loops_svg(drawing_of(fabric)));
}

TEST(FigureText, HasTheDigitsFiguresArePrintedWith) {
  EXPECT_EQ(figure_text(0.0), "0.000");
  EXPECT_EQ(figure_text(0.0172), "0.0172");
  EXPECT_EQ(figure_text(5.515), "5.515");
  EXPECT_EQ(figure_text(54.1), "54.10");
}

}  // namespace
}  // namespace semblance
