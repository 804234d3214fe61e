#include "semblance/cloth/kes.h"

#include <fmt/format.h>

#include <cmath>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Figure = KesFigures::Figure;

/// Typical of woven clothes, for what is not given.
namespace typical {
constexpr double emt_pct = 6.0, lt = 0.61, rt_pct = 62.0;
constexpr double g_gf_cm_deg = 1.0, hg2_over_g_deg = 1.2, hg5_over_hg2 = 2.0;
constexpr double b_gf_cm2_cm = 0.1, hb2_over_b_1_cm = 0.5;
}  // namespace typical

/// LT's denominator: 500 gf/cm times one percent, halved.
constexpr double k_work_per_pct = 0.5 * 500.0 * kes::strain_from_pct;

/// What figures may be. LT below 0.1 and above 1.5 has not been seen.
struct Limits {
  const char* symbol;
  double lower, upper;
};
constexpr Limits k_limits[] = {{"EMT", 0.1, 150.0},  {"LT", 0.1, 1.5},   {"WT", 0.05, 500.0},
                               {"RT", 5.0, 100.0},   {"G", 0.05, 100.0}, {"2HG", 0.0, 500.0},
                               {"2HG5", 0.0, 500.0}, {"B", 1e-4, 20.0},  {"2HB", 0.0, 20.0}};

std::string full_name(const FigureName& name) {
  return *name.direction == 0 ? name.symbol : fmt::format("{} {}", name.symbol, name.direction);
}

void check_limits(const KesFigures& figures, const std::string& source) {
  std::vector<std::string> problems;
  for_each_figure(figures, [&](const FigureName& name, const Figure& figure) {
    if (!figure) return;
    for (const Limits& limits : k_limits) {
      if (std::string(limits.symbol) != name.symbol) continue;
      if (*figure >= limits.lower && *figure <= limits.upper) return;
      problems.push_back(fmt::format("{} is {:g}; {:g} to {:g}{}{} was expected", full_name(name),
                                     *figure, limits.lower, limits.upper,
                                     *name.unit == 0 ? "" : " ", name.unit));
    }
  });
  if (!problems.empty()) {
    throw InvalidInput(
        fmt::format("{}: {}; are the figures in KES units?", source, fmt::join(problems, "; ")));
  }
}

/// Twice the mean of (exp(b x) - 1) / (exp(b) - 1) over [0, 1]: falls from 2 to 0 as b rises.
double linearity(double b) {
  if (std::abs(b) < 1e-3) return 1.0 - b / 6.0;
  return 2.0 * (1.0 / b - 1.0 / std::expm1(b));
}

double exponent_of(double wanted) {
  double low = -700.0, high = 700.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (linearity(middle) > wanted ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// Relative force at a relative strain.
double exponential(double b, double x) {
  return std::abs(b) < 1e-9 ? x : std::expm1(b * x) / std::expm1(b);
}

/// Even in strain, and even in force on the steeper branch.
std::vector<double> tension_places(double b) {
  constexpr int count = 48;
  std::vector<double> places;
  for (int i = 0; i <= count; ++i) {
    const double t = static_cast<double>(i) / count;
    places.push_back(t);
    if (std::abs(b) > 1e-9)
      places.push_back(std::clamp(std::log1p(t * std::expm1(b)) / b, 0.0, 1.0));
  }
  std::sort(places.begin(), places.end());
  const auto close = [](double a, double c) { return c - a < 1e-4; };
  places.erase(std::unique(places.begin(), places.end(), close), places.end());
  places.back() = 1.0;
  return places;
}

class Maker {
 public:
  Maker(const KesFigures& figures, std::string source)
      : figures_(figures), source_(std::move(source)) {}

  Fabric make() {
    check_limits(figures_, source_);
    Fabric fabric;
    fabric.name = figures_.name;
    fabric.area_density_kg_m2 = figures_.weight_g_m2.value_or(0.0) * kes::kg_m2_from_g_m2;
    fabric.thickness_m = figures_.thickness_mm.value_or(0.0) * kes::m_from_mm;
    if (figures_.mean_of_directions) {
      assume("warp and weft are not given apart: both have the given figures");
    }
    share(figures_.tension, "tension", [](const auto& t) { return t.emt_pct || t.wt_gf_cm_cm2; });
    share(figures_.bending, "bending", [](const auto& b) { return b.b_gf_cm2_cm.has_value(); });
    fabric.tension = {tension(warp), tension(weft)};
    fabric.shear = shear();
    fabric.bending = {bending(warp), bending(weft)};
    fabric.assumptions = assumptions_;
    complete_fabric(fabric, std::nullopt, std::nullopt);
    fabric.assumptions.push_back(viscosity_assumption());
    fabric.assumptions.push_back(reversal_assumption());
    validate(fabric, source_);
    return fabric;
  }

 private:
  void assume(const std::string& what) {
    // Warp and weft often lack the same.
    if (std::find(assumptions_.begin(), assumptions_.end(), what) == assumptions_.end()) {
      assumptions_.push_back(what);
    }
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw InvalidInput(source_ + ": " + what);
  }

  /// The given figure, or another that is stated.
  double given_or(const Figure& figure, double other, const char* symbol, const char* reason) {
    if (figure) return *figure;
    assume(fmt::format("{} not given: {:.3g}, {}", symbol, other, reason));
    return other;
  }

  /// A direction of which nothing is known is like the other.
  template <class Pair, class Known>
  void share(Pair& pair, const char* mode, const Known& known) {
    for (const std::size_t d : {warp, weft}) {
      if (known(pair[d]) || !known(pair[1 - d])) continue;
      assume(fmt::format("{} along {} not given: as along {}", mode, d == warp ? "warp" : "weft",
                         d == warp ? "weft" : "warp"));
      pair[d] = pair[1 - d];
    }
  }

  /// EMT and LT from two of EMT, LT and WT.
  void linearity_and_strain(const KesFigures::Tension& given, double& emt_pct, double& lt) {
    if (!given.emt_pct && given.wt_gf_cm_cm2) {
      lt = given_or(given.lt, typical::lt, "LT", "typical of woven clothes");
      emt_pct = *given.wt_gf_cm_cm2 / (k_work_per_pct * lt);
      return;
    }
    emt_pct = given_or(given.emt_pct, typical::emt_pct, "EMT in %", "typical of woven clothes");
    if (!given.wt_gf_cm_cm2) {
      lt = given_or(given.lt, typical::lt, "LT", "typical of woven clothes");
      return;
    }
    const double by_work = *given.wt_gf_cm_cm2 / (k_work_per_pct * emt_pct);
    if (given.lt) check_work(*given.lt, by_work, emt_pct);
    lt = given.lt ? std::sqrt(*given.lt * by_work) : by_work;
  }

  void check_work(double lt, double by_work, double emt_pct) {
    constexpr double most = 0.06, notable = 0.01;
    const double difference = std::abs(by_work / lt - 1.0);
    if (difference > most) {
      fail(fmt::format(
          "LT {:g} and EMT {:g} % make WT {:.4g} gf cm/cm2, not {:.4g}: one of the three "
          "is misprinted (LT = WT / (500 gf/cm EMT / 2)); leave it out",
          lt, emt_pct, lt * emt_pct * k_work_per_pct, by_work * emt_pct * k_work_per_pct));
    }
    if (difference > notable) {
      assume(fmt::format("LT {:g} and WT disagree by {:.1f} %: the middle, LT {:.3g}, is taken", lt,
                         100.0 * difference, std::sqrt(lt * by_work)));
    }
  }

  ModeResponse tension(Direction direction) {
    const KesFigures::Tension& given = figures_.tension[direction];
    double emt_pct = 0.0, lt = 0.0;
    linearity_and_strain(given, emt_pct, lt);
    if (!(lt >= 0.1 && lt <= 1.5)) {
      fail(fmt::format("EMT and WT make LT {:.3g}; 0.1 to 1.5 was expected", lt));
    }
    const double rt_pct =
        given_or(given.rt_pct, typical::rt_pct, "RT in %", "typical of woven clothes");
    const double end = emt_pct * kes::strain_from_pct;
    const double up = exponent_of(lt), down = exponent_of(lt * rt_pct / 100.0);
    std::vector<double> strain, loading, unloading;
    for (const double x : tension_places(down)) {
      strain.push_back(x * end);
      loading.push_back(kes::tension_end_n_m * exponential(up, x));
      unloading.push_back(kes::tension_end_n_m * exponential(down, x));
    }
    // A slider that turned slower than the loop closes would leave the elastic force a dent.
    const double reversal = end * std::min(default_reversal_fraction, 0.5 / (down * down));
    return response_from_loop({strain, loading}, {strain, unloading}, Turns::closing, reversal,
                              source_ + ": tension");
  }

  ModeResponse shear() {
    const KesFigures::Shear& given = figures_.shear;
    const double g = given_or(given.g_gf_cm_deg, typical::g_gf_cm_deg, "G in gf/(cm deg)",
                              "typical of woven clothes");
    // Where only one width is known the other follows from it.
    const double hg2 = given.hg2_gf_cm || !given.hg5_gf_cm
                           ? given_or(given.hg2_gf_cm, typical::hg2_over_g_deg * g, "2HG in gf/cm",
                                      "in proportion to G as in woven clothes")
                           : given_or(given.hg2_gf_cm, *given.hg5_gf_cm / typical::hg5_over_hg2,
                                      "2HG in gf/cm", "in proportion to 2HG5 as in woven clothes");
    const double hg5 = given_or(given.hg5_gf_cm, typical::hg5_over_hg2 * hg2, "2HG5 in gf/cm",
                                "in proportion to 2HG as in woven clothes");
    return shear_of(g, 0.5 * hg2, 0.5 * hg5);
  }

  ModeResponse shear_of(double g, double half_at_05, double half_at_5) const {
    const double friction_slope = (half_at_5 - half_at_05) / 4.5;
    if (!(friction_slope < g)) {
      fail(fmt::format(
          "from 0.5 to 5 deg friction grows by {:.3g} gf/cm per deg, and G is only {:g}: "
          "2HG5 is too large or G too small",
          friction_slope, g));
    }
    std::vector<double> angle, friction;
    for (const double deg : {0.0, 0.5, 2.5, 5.0, 8.0}) {
      angle.push_back(deg * kes::rad_from_deg);
      friction.push_back(std::max(0.0, half_at_05 + friction_slope * (deg - 0.5)) *
                         kes::n_m_from_gf_cm);
    }
    return {Curve::linear((g - friction_slope) * kes::n_m_rad_from_gf_cm_deg, kes::shear_end_rad),
            Curve(angle, friction, Curve::Beyond::constant),
            default_reversal_fraction * kes::shear_end_rad, default_viscosity_s};
  }

  ModeResponse bending(Direction direction) {
    const KesFigures::Bending& given = figures_.bending[direction];
    const double b = given_or(given.b_gf_cm2_cm, typical::b_gf_cm2_cm, "B in gf cm2/cm",
                              "typical of woven clothes");
    const double hb2 = given_or(given.hb2_gf_cm_cm, typical::hb2_over_b_1_cm * b, "2HB in gf cm/cm",
                                "in proportion to B as in woven clothes");
    return linear_response(b * kes::n_m_from_gf_cm2_cm, kes::bending_end_1_m,
                           0.5 * hb2 * kes::n_from_gf_cm_cm);
  }

  KesFigures figures_;
  std::string source_;
  std::vector<std::string> assumptions_;
};

}  // namespace

Fabric fabric_from_figures(const KesFigures& figures, const std::string& source) {
  return Maker(figures, source).make();
}

}  // namespace semblance
