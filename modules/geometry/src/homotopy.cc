#include "semblance/geometry/homotopy.h"

#include <cmath>
#include <string>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

void require_blend_parameter(double n) {
  if (!(n > -1.0) || !std::isfinite(n)) {
    throw InvalidInput("blending parameter n = " + std::to_string(n) +
                       " must exceed -1 and be finite");
  }
}

ValueSlope product(const ValueSlope& a, const ValueSlope& b) {
  return {a.value * b.value, a.slope * b.value + a.value * b.slope};
}

ValueSlope shaped_scaling(double v, double start_slope, const ScalingShape& shape) {
  return scaling_through(v, start_slope, shape.alpha,
                         shape.height * start_slope * shape.alpha * (1.0 - shape.alpha));
}

}  // namespace

ValueSlope blend_rational(double v, double n) {
  require_blend_parameter(n);
  const double denominator = 1.0 + n * v;
  return {(1.0 + n) * v / denominator, (1.0 + n) / (denominator * denominator)};
}

ValueSlope blend_flat(double v, double n) {
  require_blend_parameter(n);
  const double c = 1.0 + n, w = 1.0 - v;
  const double denominator = c * v * v + w * w;
  return {c * v * v / denominator, 2.0 * c * v * w / (denominator * denominator)};
}

Blend blend(BlendForm form, double v, double n) {
  const double w = 1.0 - v, c = 1.0 + n;
  if (form == BlendForm::rational) {
    const double d = 1.0 + n * v;
    return {blend_rational(v, n), v * w / (d * d), (d - 2.0 * c * v) / (d * d * d)};
  }
  const double d = c * v * v + w * w;
  return {blend_flat(v, n), v * v * w * w / (d * d),
          2.0 * v * w * (w * w - c * v * v) / (d * d * d)};
}

ValueSlope scaling_through(double v, double start_slope, double alpha, double beta) {
  if (!(alpha > 0.0 && alpha < 1.0)) {
    throw InvalidInput("scaling function: alpha = " + std::to_string(alpha) +
                       " must lie strictly between 0 and 1");
  }
  // b from the slope at 0, a from the point (alpha, beta).
  const double b = -start_slope;
  const double a = (beta / (alpha * (alpha - 1.0)) - b) / alpha;
  return {v * (v - 1.0) * (a * v + b), (2.0 * v - 1.0) * (a * v + b) + v * (v - 1.0) * a};
}

ValueSlope scaling_parabola(double v, double start_slope) {
  return {start_slope * v * (1.0 - v), start_slope * (1.0 - 2.0 * v)};
}

ValueSlope HomotopyPath::at(double v) const {
  const ValueSlope blend = blend_flat(v, n);
  ValueSlope first = shaped_scaling(v, start_slope, start_shape);
  // The mirror image: a function of 1 - v with slope -end_slope in its own variable.
  ValueSlope second = shaped_scaling(1.0 - v, -end_slope, end_shape);
  second.slope = -second.slope;
  first.value += start;
  second.value += end;
  const ValueSlope a = product({1.0 - blend.value, -blend.slope}, first);
  const ValueSlope b = product(blend, second);
  return {a.value + b.value, a.slope + b.slope};
}

HomotopyWeights homotopy_weights(double v, double n) {
  const ValueSlope blend = blend_flat(v, n), bow = scaling_parabola(v, 1.0);
  HomotopyWeights weights;
  weights.change = blend;
  weights.start = product({1.0 - blend.value, -blend.slope}, bow);
  weights.end = product({-blend.value, -blend.slope}, bow);
  return weights;
}

}  // namespace semblance
