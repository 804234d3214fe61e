// One-dimensional homotopies with given end values and end slopes.
//
// Source: Moubaraki, Tanaka and Kitamura, "Evaluation of the Homotopy Sweep Technique", ATR
// TR-C-0089 (1993), sections 2.3, 2.4, 4.3 and appendix I, after Tai, Loe and Kunii (1991). The
// printed formulas were derived again: what holds here are the stated end conditions.
#pragma once

namespace semblance {

/// A function's value and its first derivative.
struct ValueSlope {
  double value = 0.0, slope = 0.0;
};

/// Blending function (1+n) v / (1 + n v) on [0, 1]: from 0 to 1, monotone, n = 0 linear.
///
/// Both blending functions need n > -1. At n = -1 they are 0 for all v < 1 and undefined at 1;
/// below, their denominators vanish inside (0, 1). Throws InvalidInput otherwise.
ValueSlope blend_rational(double v, double n);

/// Blending function (1+n) v^2 / ((1+n) v^2 + (1-v)^2) on [0, 1]: from 0 to 1, monotone, with zero
/// slope at both ends, so that end slopes are left to the scaling functions (report, eq. 8).
ValueSlope blend_flat(double v, double n);

enum class BlendForm { rational, flat };

/// A blending function with its derivatives by n.
struct Blend : ValueSlope {
  double value_dn = 0.0, slope_dn = 0.0;
};
Blend blend(BlendForm form, double v, double n);

/// Scaling function v (v-1) (a v + b): zero at both ends, slope `start_slope` at v = 0, through
/// (`alpha`, `beta`) with 0 < alpha < 1 (appendix I). Throws InvalidInput for other alpha.
ValueSlope scaling_through(double v, double start_slope, double alpha, double beta);

/// The parabola start_slope v (1-v): zero at both ends, slopes start_slope and -start_slope.
ValueSlope scaling_parabola(double v, double start_slope);

/// Where a path's two scaling functions pass, relative to the parabola of the same slope: S1 goes
/// through (alpha, height * parabola's top), S2 mirrored. alpha = 1/2, height = 1 is the parabola.
struct ScalingShape {
  double alpha = 0.5, height = 1.0;
};

/// A path from `start` to `end` over v in [0, 1] with given slopes d/dv at its ends.
///
/// value(v) = (1-R)(start + s1) + R (end + s2) with R = blend_flat(v, n), s1 a scaling function of
/// slope `start_slope` at 0, s2 one of slope `end_slope` at 1. It is the report's
/// r(v) = (1-R)(1+S1) r1 + R (1+S2) r2 with s_i = S_i r_i, so S_i' = slope_i / r_i; written with
/// s_i it needs no r_i different from zero and so contains its offset form
/// w(v) = (1-R)(1+S1) A + R (1+S2)(w2+A) - A for every offset A (section 4.3.2). With n = 0 and
/// parabolas a straight line is reproduced exactly.
struct HomotopyPath {
  double start = 0.0, end = 0.0;
  double start_slope = 0.0, end_slope = 0.0;
  double n = 0.0;
  ScalingShape start_shape{}, end_shape{};

  ValueSlope at(double v) const;
};

/// The three functions of v whose sum, weighted with (end - start), start_slope and end_slope, is
/// HomotopyPath::at(v) - start for the default shapes: R, (1-R) v (1-v) and -R v (1-v). They are
/// common to all paths with the same n, whatever their ends.
struct HomotopyWeights {
  ValueSlope change, start, end;
};
HomotopyWeights homotopy_weights(double v, double n);

}  // namespace semblance
