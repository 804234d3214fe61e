#include "semblance/models/sweep_model.h"

#include <gmock/gmock.h>

#include "semblance/models/contract.h"

namespace semblance {
namespace {

TEST(SweepModel, KeepsTheContractOfModels) {
  const MovingFrame frame(make_spline({{0, 0, 0}, {0.1, 0.3, 0}, {0.0, 0.6, 0.2}, {0, 1, 0}}),
                          FrameKind::rotation_minimising);
  std::vector<SweepContour> contours;
  for (const char* shape : {"circle", "square", "ellipse"}) {
    SweepContour c{.contour = PlanarContour(named_outline(shape, 0.2, 10))};
    c.position = 0.5 * static_cast<double>(contours.size());
    c.slope = Eigen::Vector2d(0.5, -1.0);
    contours.push_back(c);
  }
  contours[1].bias = 1.2;
  contours[1].slope_after = Eigen::Vector2d(1.0, 0.3);
  std::vector<SweepSegment> segments(2);
  segments[0].n = 1.5;
  segments[1].features_y = {{0.4, 0.2}};
  EXPECT_MODEL_CONTRACT(SweepModel(SweepSurface(frame, contours, segments), 24, 6));
}

}  // namespace
}  // namespace semblance
