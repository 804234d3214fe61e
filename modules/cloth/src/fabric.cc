#include "semblance/cloth/fabric.h"

#include <fmt/format.h>

#include <cmath>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

/// Of the largest force: what rounding and a sensor's noise may put on the wrong side.
constexpr double k_slack = 1e-3;

/// The points that lie in [low, high]; two are needed.
Curve part_of(const Curve& curve, double low, double high, const char* branch,
              const std::string& source) {
  std::vector<double> x, values;
  const double slack = 1e-9 * curve.last();
  for (std::size_t i = 0; i < curve.x().size(); ++i) {
    if (curve.x()[i] < low - slack || curve.x()[i] > high + slack) continue;
    x.push_back(curve.x()[i]);
    values.push_back(curve.values()[i]);
  }
  if (x.size() < 2) {
    throw InvalidInput(
        fmt::format("{}: {} has fewer than two points between {:g} and {:g}, where friction has "
                    "turned round; add points there",
                    source, branch, low, high));
  }
  return {x, values};
}

/// The first curve's places and the second's up to the first one's end.
std::vector<double> merged_places(std::vector<double> places, const std::vector<double>& more) {
  const double end = places.back();
  for (const double x : more) {
    if (x < end) places.push_back(x);
  }
  std::sort(places.begin(), places.end());
  // Places that differ by rounding only would make steps of their differences.
  const auto same = [&](double a, double b) { return b - a < 1e-9 * end; };
  places.erase(std::unique(places.begin(), places.end(), same), places.end());
  return places;
}

void check_ends(const Curve& loading, const Curve& unloading, const std::string& source) {
  const double end = loading.last();
  if (std::abs(unloading.last() - end) > 1e-6 * end) {
    throw InvalidInput(
        fmt::format("{}: loading ends at {:g} and unloading begins at {:g}; both are measured from "
                    "0 to the same end",
                    source, end, unloading.last()));
  }
}

void check_width(double up, double down, double x, double largest, const std::string& source) {
  if (down - up <= k_slack * std::abs(largest)) return;
  throw InvalidInput(fmt::format(
      "{}: at {:g} unloading takes {:g} and loading only {:g}; are the two branches exchanged?",
      source, x, down, up));
}

void check_rises(const std::vector<double>& x, const std::vector<double>& values,
                 const std::string& source) {
  for (std::size_t i = 1; i < x.size(); ++i) {
    if (values[i] > values[i - 1]) continue;
    throw InvalidInput(fmt::format(
        "{}: the mean of loading and unloading does not rise between {:g} and {:g} (from "
        "{:g} to {:g}); smooth the measurement, or leave such points out",
        source, x[i - 1], x[i], values[i - 1], values[i]));
  }
}

/// Of branches that meet at 0 and at the end: loading = elastic + friction s and unloading likewise
/// with the slider's s, which both know from the travel since the turn.
ModeResponse closed_loop(const Curve& loading, const Curve& unloading, double reversal,
                         const std::string& source) {
  const double end = loading.last();
  const std::vector<double> x =
      merged_places(common_places(loading, unloading),
                    {0.0, 0.5 * reversal, reversal, end - 2.0 * reversal, end - reversal, end});
  std::vector<double> force, friction;
  for (const double place : x) {
    const CurvePoint above = loading.evaluate(place), below = unloading.evaluate(place);
    check_width(above.value, below.value, place, loading.value(end), source);
    const double loaded = std::min(1.0, place / reversal);
    const double unloaded = std::max(-1.0, 1.0 - (end - place) / reversal);
    const double width = place < end ? (above.value - below.value) / (loaded - unloaded)
                                     : reversal * (below.slope - above.slope);
    friction.push_back(std::max(0.0, width));
    force.push_back(place > 0.0 ? above.value - friction.back() * loaded : 0.0);
  }
  check_rises(x, force, source);
  return {Curve(x, force), Curve(x, friction, Curve::Beyond::constant), reversal,
          default_viscosity_s};
}

}  // namespace

ModeResponse linear_response(double stiffness, double end, double friction) {
  return {Curve::linear(stiffness, end), Curve::constant(friction, end),
          default_reversal_fraction * end, default_viscosity_s};
}

ModeResponse response_from_loop(const Curve& loading, const Curve& unloading, Turns turns,
                                double reversal, const std::string& source) {
  check_ends(loading, unloading, source);
  const double end = loading.last();
  if (reversal == 0.0) reversal = default_reversal_fraction * end;
  if (!(reversal > 0.0 && reversal < 0.2 * end)) {
    throw InvalidInput(
        fmt::format("{}: reversal {:g} must be positive and below a fifth of the range of {:g}",
                    source, reversal, end));
  }
  if (turns == Turns::closing) return closed_loop(loading, unloading, reversal, source);
  const Curve up = part_of(loading, reversal, end, "loading", source);
  const Curve down = part_of(unloading, 0.0, end - 2.0 * reversal, "unloading", source);
  std::vector<double> x = common_places(up, down), force, friction;
  if (x.front() > 0.0) x.insert(x.begin(), 0.0);
  if (x.back() < end) x.push_back(end);
  for (const double place : x) {
    const double above = up.value(place), below = down.value(place);
    const bool inside = place > reversal && place < end - 2.0 * reversal;
    if (inside) check_width(above, below, place, loading.value(end), source);
    friction.push_back(std::max(0.0, 0.5 * (above - below)));
    force.push_back(place > 0.0 ? above - friction.back() : 0.0);
  }
  check_rises(x, force, source);
  return {Curve(x, force), Curve(x, friction, Curve::Beyond::constant), reversal,
          default_viscosity_s};
}

void complete_fabric(Fabric& fabric, std::optional<double> friction,
                     std::optional<double> mass_damping_1_s) {
  const auto assume = [&](const std::string& what) { fabric.assumptions.push_back(what); };
  if (fabric.area_density_kg_m2 == 0.0) {
    const bool by_thickness = fabric.thickness_m > 0.0;
    fabric.area_density_kg_m2 = by_thickness ? assumed::bulk_density_kg_m3 * fabric.thickness_m
                                             : assumed::area_density_kg_m2;
    assume(fmt::format(
        "area density not given: {:.0f} g/m2, {}", 1000.0 * fabric.area_density_kg_m2,
        by_thickness ? fmt::format("{:g} kg/m3 times the thickness", assumed::bulk_density_kg_m3)
                     : "the median of 618 fabrics (Feng 2022)"));
  }
  if (fabric.thickness_m == 0.0) {
    fabric.thickness_m = fabric.area_density_kg_m2 / assumed::bulk_density_kg_m3;
    assume(fmt::format("thickness not given: {:.2f} mm, the area density over {:g} kg/m3",
                       1000.0 * fabric.thickness_m, assumed::bulk_density_kg_m3));
  }
  fabric.friction = friction.value_or(assumed::friction);
  if (!friction) {
    assume(fmt::format("coefficient of friction not given: {:g}, as between cloths and on wood",
                       assumed::friction));
  }
  fabric.mass_damping_1_s = mass_damping_1_s.value_or(assumed::mass_damping_1_s);
  if (!mass_damping_1_s) {
    assume(fmt::format("mass damping not given: {:g} 1/s, for the air", assumed::mass_damping_1_s));
  }
}

std::string viscosity_assumption() {
  return fmt::format("viscosity not given: {:g} s (3 % of critical damping at 10 Hz)",
                     default_viscosity_s);
}

std::string reversal_assumption() {
  return fmt::format(
      "reversal not given: friction turns round over {:g} % of the measured range at most",
      100.0 * default_reversal_fraction);
}

namespace {

ModeResponse assumed_twist(const ModeResponse& a, const ModeResponse& b) {
  const std::vector<double> x = common_places(a.elastic, b.elastic);
  std::vector<double> moment;
  for (const double place : x) moment.push_back(a.elastic.value(place) + b.elastic.value(place));
  return {Curve(x, moment), Curve::constant(0.0, x.back()), 0.5 * (a.reversal + b.reversal),
          0.5 * (a.viscosity_s + b.viscosity_s)};
}

ModeResponse measured_twist(const ModeResponse& bias, const ModeResponse& a,
                            const ModeResponse& b) {
  const auto by_identity = [&](const Curve ModeResponse::*curve, double x) {
    return 2.0 * (bias.*curve).value(2.0 * x) - (a.*curve).value(x) - (b.*curve).value(x);
  };
  std::vector<double> x;
  for (const double place : bias.elastic.x()) x.push_back(0.5 * place);
  x = merged_places(x, common_places(a.elastic, b.elastic));
  std::vector<double> moment, friction;
  for (const double place : x) {
    moment.push_back(by_identity(&ModeResponse::elastic, place));
    friction.push_back(std::max(0.0, by_identity(&ModeResponse::friction, place)));
  }
  for (std::size_t i = 1; i < x.size(); ++i) {
    if (moment[i] > moment[i - 1]) continue;
    throw InvalidInput(fmt::format(
        "bending along the bias is too weak to be possible: up to a curvature of {:g} 1/m its "
        "moment "
        "rises by less than the mean of warp's and weft's does up to half of that; measure again, "
        "or leave the bias out (it is then taken as the mean of warp and weft)",
        2.0 * x[i]));
  }
  return {Curve(x, moment), Curve(x, friction, Curve::Beyond::constant), 0.5 * bias.reversal,
          bias.viscosity_s};
}

}  // namespace

Curve loading_curve(const ModeResponse& mode) {
  if (mode.friction.largest_value() <= 0.0) return mode.elastic;
  const double slips = mode.reversal;
  const std::vector<double> x =
      merged_places(common_places(mode.elastic, mode.friction), {0.5 * slips, slips, 2.0 * slips});
  std::vector<double> force;
  for (const double e : x) {
    force.push_back(mode.elastic.value(e) + mode.friction.value(e) * std::min(1.0, e / slips));
  }
  return {x, force, mode.elastic.beyond()};
}

ModeResponse twist_response(const Fabric& fabric) {
  const ModeResponse &a = fabric.bending[warp], &b = fabric.bending[weft];
  return fabric.bending_bias ? measured_twist(*fabric.bending_bias, a, b) : assumed_twist(a, b);
}

namespace {

/// What a value may be, and the unit that was probably meant where it is not.
struct Range {
  double lower, upper;
  const char* unit;
  const char* below;  // what to say of smaller values
  const char* above;  // and of larger ones
};

// From tissue to felt. Feng et al. (2022) found 0.030 to 0.487 kg/m2 in nine fabrics of ten.
constexpr Range k_area_density{0.01, 3.0, "kg/m2", "did you mean kg/m2, and wrote g/m2?",
                               "did you mean g/m2?"};
constexpr Range k_thickness{2e-5, 1e-2, "m", "did you mean mm, and wrote m?", "did you mean mm?"};
constexpr Range k_friction{0.0, 2.0, "", "", "is it a coefficient (0.1 to 1)?"};
constexpr Range k_mass_damping{0.0, 100.0, "1/s", "", "is it in 1/s?"};
constexpr Range k_viscosity{0.0, 1.0, "s", "", "did you mean ms?"};

/// The end of the measured range, and force over deformation there.
struct ModeRange {
  Range end, secant;
};

// KES pulls with 490 N/m: knits yield by half of their length, denim by 5 %, glass by 0.2 %.
constexpr ModeRange k_tension{
    {1e-3, 1.5, "", "is it a strain (0.05 is 5 %)?", "did you mean %?"},
    {50.0, 1e6, "N/m", "did you mean N/cm or kN/m?", "did you mean N/m, and wrote mN/m or Pa?"}};
// G of clothes is 0.2 to 5 gf/(cm deg), 11 to 280 N/m per rad.
constexpr ModeRange k_shear{
    {0.01, 1.2, "rad", "is it in rad?", "did you mean deg?"},
    {5.0, 2e4, "N/m per rad", "did you mean gf/(cm deg), 56.19 N/m per rad?",
     "did you mean N/m per rad, and wrote mN/m?"}};
// Nine fabrics of ten have 0.85 to 109 uN m (Feng et al. 2022): a hundredth and twenty times that.
constexpr ModeRange k_bending{{5.0, 5e3, "1/m", "did you mean 1/cm?", "is it in 1/m?"},
                              {1e-8, 2e-3, "N m", "did you mean N m, and wrote mN m?",
                               "did you mean gf cm2/cm (9.807e-5 N m), or uN m?"}};

class Validation {
 public:
  void number(const std::string& what, double value, const Range& range) {
    if (value >= range.lower && value <= range.upper) return;
    const char* const hint = value < 0.0           ? "it cannot be negative: mend the sign"
                             : value < range.lower ? range.below
                                                   : range.above;
    problem(fmt::format("{}: {:g} is not between {:g} and {:g}{}{}{}{}", what, value, range.lower,
                        range.upper, *range.unit != 0 ? " " : "", range.unit,
                        *hint != 0 ? "; " : "", hint));
  }

  void mode(const std::string& name, const ModeResponse& mode, const ModeRange& range) {
    const std::size_t before = problems_.size();
    elastic(name, mode.elastic);
    friction(name, mode);
    number(name + " viscosity_s", mode.viscosity_s, k_viscosity);
    const double end = mode.elastic.last();
    if (!(mode.reversal > 0.0 && mode.reversal <= end)) {
      problem(fmt::format("{} reversal: {:g} must be positive and within the range of {:g}", name,
                          mode.reversal, end));
    }
    if (problems_.size() != before) return;
    number(name + ": end of the measured range", end, range.end);
    number(name + ": stiffness over the measured range", mode.elastic.value(end) / end,
           range.secant);
  }

  void twist(const Fabric& fabric) {
    if (!problems_.empty() || !fabric.bending_bias) return;
    try {
      twist_response(fabric);
    } catch (const InvalidInput& error) {
      problem(error.what());
    }
  }

  void finish(const std::string& source) const {
    if (problems_.empty()) return;
    throw InvalidInput(fmt::format("{}: {}", source, fmt::join(problems_, "; ")));
  }

 private:
  void problem(const std::string& what) { problems_.push_back(what); }

  void elastic(const std::string& name, const Curve& curve) {
    const auto &x = curve.x(), &force = curve.values();
    if (x[0] != 0.0 || force[0] != 0.0) {
      problem(fmt::format("{}: the elastic curve begins at ({:g}, {:g}); it must begin at (0, 0)",
                          name, x[0], force[0]));
    }
    for (std::size_t i = 1; i < x.size(); ++i) {
      if (force[i] > force[i - 1]) continue;
      return problem(fmt::format(
          "{}: the elastic curve does not rise between {:g} and {:g} (from {:g} to {:g}); smooth "
          "the measurement, or leave such points out",
          name, x[i - 1], x[i], force[i - 1], force[i]));
    }
  }

  void friction(const std::string& name, const ModeResponse& mode) {
    const auto& values = mode.friction.values();
    const double least = *std::min_element(values.begin(), values.end());
    if (least < 0.0) {
      problem(
          fmt::format("{}: friction is {:g} somewhere; it is half of the loop's width and "
                      "cannot be negative",
                      name, least));
    }
    const double most = mode.friction.largest_value();
    const double force = mode.elastic.value(mode.elastic.last());
    // A loop so wide has no slope that could be measured.
    constexpr double widest = 5.0;
    if (most > widest * force) {
      problem(
          fmt::format("{}: friction reaches {:g} and the elastic force only {:g}; are both in "
                      "the same unit?",
                      name, most, force));
    }
    if (mode.friction.beyond() == Curve::Beyond::linear && values.back() < values.front()) {
      problem(fmt::format("{}: friction falls and goes on falling behind its last point", name));
    }
  }

  std::vector<std::string> problems_;
};

}  // namespace

void validate(const Fabric& fabric, const std::string& source) {
  Validation validation;
  validation.number("area density", fabric.area_density_kg_m2, k_area_density);
  validation.number("thickness", fabric.thickness_m, k_thickness);
  validation.number("friction", fabric.friction, k_friction);
  validation.number("mass damping", fabric.mass_damping_1_s, k_mass_damping);
  validation.mode("tension along warp", fabric.tension[warp], k_tension);
  validation.mode("tension along weft", fabric.tension[weft], k_tension);
  validation.mode("shear", fabric.shear, k_shear);
  validation.mode("bending along warp", fabric.bending[warp], k_bending);
  validation.mode("bending along weft", fabric.bending[weft], k_bending);
  if (fabric.bending_bias) validation.mode("bending along bias", *fabric.bending_bias, k_bending);
  validation.twist(fabric);
  validation.finish(source);
}

}  // namespace semblance
