#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "fabric_parts.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/json_reader.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

constexpr const char* k_schema = "semblance.fabric/1";
constexpr double k_largest = 1e9;

using Points = std::vector<Eigen::Vector2d>;

/// One mode's object, in its own units.
class ModeReader {
 public:
  ModeReader(JsonReader& in, FabricParts& parts, std::size_t mode, ModeUnits units)
      : in_(in), parts_(parts), mode_(mode), units_(units) {}

  void read(const std::string& source) {
    const bool measured = in_.find("loading") != nullptr;
    const bool separated = in_.find("elastic") != nullptr;
    const bool linear = in_.find("stiffness") != nullptr;
    if (measured + separated + linear != 1) {
      in_.fail("curves",
               "one of 'loading' (with 'unloading'), 'elastic' (with 'friction') and "
               "'stiffness'");
    }
    double reversal = 0.0, viscosity = default_viscosity_s;
    in_.number("reversal", reversal, 0.0, k_largest);
    in_.number("viscosity_s", viscosity, 0.0, k_largest);
    parts_.assumes_reversal |= in_.find("reversal") == nullptr;
    parts_.assumes_viscosity |= in_.find("viscosity_s") == nullptr;
    reversal *= units_.deformation;
    if (measured) read_measured(reversal, source);
    if (separated) read_separated(reversal);
    if (linear) read_linear(reversal);
    parts_.modes[mode_]->viscosity_s = viscosity;
  }

 private:
  Points points(const char* key) {
    Points list;
    in_.vectors(key, list);
    if (list.size() > most_curve_points) {
      in_.fail(key, fmt::format("at most {} points", most_curve_points));
    }
    in_.check();
    return list;
  }

  Loop samples(const char* key) {
    Loop loop;
    for (const Eigen::Vector2d& point : points(key)) {
      loop.push_back({point.x() * units_.deformation, point.y() * units_.force});
    }
    return loop;
  }

  Curve curve(const char* key, Curve::Beyond beyond) {
    std::vector<double> x, values;
    for (const LoopSample& sample : samples(key)) {
      x.push_back(sample.deformation);
      values.push_back(sample.force);
    }
    try {
      return {x, values, beyond};
    } catch (const InvalidInput& error) {
      in_.problem(key, error.what());
      in_.check();
      throw;
    }
  }

  void read_measured(double reversal, const std::string& source) {
    const Loop loading = samples("loading"), unloading = samples("unloading");
    in_.check();
    add_measured_mode(parts_, mode_, {loading, unloading}, reversal, source);
  }

  void read_separated(double reversal) {
    in_.required("friction");
    in_.check();
    const Curve elastic = curve("elastic", Curve::Beyond::linear);
    const Curve friction = curve("friction", Curve::Beyond::constant);
    parts_.modes[mode_] =
        ModeResponse{elastic, friction,
                     reversal > 0.0 ? reversal : default_reversal_fraction * elastic.last(), 0.0};
  }

  /// How far the test goes, where the file does not say how far it was measured.
  double default_end(double stiffness) const {
    switch (mode_names[mode_].kind) {
      case ModeKind::tension:
        return kes::tension_end_n_m / stiffness;
      case ModeKind::shear:
        return kes::shear_end_rad;
      case ModeKind::bending:
        break;
    }
    return kes::bending_end_1_m;
  }

  void read_linear(double reversal) {
    double stiffness = 0.0, friction = 0.0, end = 0.0;
    in_.number("stiffness", stiffness, 1e-12, k_largest);
    in_.number("friction", friction, 0.0, k_largest);
    in_.number("end", end, 1e-9, k_largest);
    in_.check();
    stiffness *= units_.force / units_.deformation;
    end = end > 0.0 ? end * units_.deformation : default_end(stiffness);
    parts_.modes[mode_] = linear_response(stiffness, end, friction * units_.force);
    if (reversal > 0.0) parts_.modes[mode_]->reversal = reversal;
  }

  JsonReader& in_;
  FabricParts& parts_;
  std::size_t mode_;
  ModeUnits units_;
};

/// A number that must not be 0: for the library 0 means that it is not known.
void read_quantity(JsonReader& in, const char* key, double unit, std::optional<double>& value) {
  if (in.find(key) == nullptr) return;
  double given = 1.0;
  in.number(key, given, -k_largest, k_largest);
  if (given == 0.0) in.problem(key, "must not be 0; leave it out where it is not known");
  value = given * unit;
}

void read_assumptions(JsonReader& in, std::vector<std::string>& assumptions) {
  const nlohmann::json* list = in.find("assumptions");
  if (list == nullptr) return;
  const auto is_text = [](const nlohmann::json& entry) { return entry.is_string(); };
  if (!list->is_array() || !std::all_of(list->begin(), list->end(), is_text)) {
    in.problem("assumptions", "expected a list of sentences");
    return;
  }
  for (const nlohmann::json& entry : *list) assumptions.push_back(entry.get<std::string>());
}

std::string list_of(const Curve& curve) {
  std::string list;
  for (std::size_t i = 0; i < curve.x().size(); ++i) {
    list += fmt::format("{}[{}, {}]", i == 0 ? "" : ", ", curve.x()[i], curve.values()[i]);
  }
  return "[" + list + "]";
}

std::string json_text(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string mode_text(const char* key, const ModeResponse& mode) {
  return fmt::format(
      ",\n \"{}\": {{\"elastic\": {},\n  \"friction\": {},\n  \"reversal\": {}, \"viscosity_s\": "
      "{}}}",
      key, list_of(mode.elastic), list_of(mode.friction), mode.reversal, mode.viscosity_s);
}

std::string fabric_text(const Fabric& fabric) {
  std::string text = fmt::format(
      "{{\"schema\": \"{}\",\n \"name\": {},\n \"units\": \"si\",\n \"area_density\": {},\n "
      "\"thickness\": {},\n \"friction\": {},\n \"mass_damping_1_s\": {}",
      k_schema, json_text(fabric.name), fabric.area_density_kg_m2, fabric.thickness_m,
      fabric.friction, fabric.mass_damping_1_s);
  text += mode_text("tension_warp", fabric.tension[warp]);
  text += mode_text("tension_weft", fabric.tension[weft]);
  text += mode_text("shear", fabric.shear);
  text += mode_text("bending_warp", fabric.bending[warp]);
  text += mode_text("bending_weft", fabric.bending[weft]);
  if (fabric.bending_bias) text += mode_text("bending_bias", *fabric.bending_bias);
  std::string sentences;
  for (const std::string& sentence : fabric.assumptions) {
    sentences += (sentences.empty() ? "\n  " : ",\n  ") + json_text(sentence);
  }
  return text + ",\n \"assumptions\": [" + sentences + "]}\n";
}

}  // namespace

FabricRecord parse_fabric_json(std::string_view content, const std::string& source) {
  const nlohmann::json json = parse_json(content, source);
  JsonReader in(json, source);
  FabricParts parts;
  std::string schema;
  in.text("schema", schema);
  if (schema != k_schema) in.fail("schema", fmt::format("\"{}\"", k_schema));
  in.text("name", parts.name, true);
  FabricUnits units = FabricUnits::si;
  in.require("units");
  in.choice("units", {{"si", FabricUnits::si}, {"kes", FabricUnits::kes}}, units);
  const bool si = units == FabricUnits::si;
  read_quantity(in, "area_density", si ? 1.0 : kes::kg_m2_from_g_m2, parts.area_density_kg_m2);
  read_quantity(in, "thickness", si ? 1.0 : kes::m_from_mm, parts.thickness_m);
  const auto optional_number = [&](const char* key, std::optional<double>& value) {
    if (in.find(key) == nullptr) return;
    value = 0.0;
    in.number(key, *value, 0.0, k_largest);
  };
  optional_number("friction", parts.friction);
  optional_number("mass_damping_1_s", parts.mass_damping_1_s);
  read_assumptions(in, parts.assumptions);
  for (std::size_t mode = 0; mode < mode_count; ++mode) {
    in.group(mode_names[mode].key, [&](JsonReader& inner) {
      ModeReader(inner, parts, mode, units_of(mode_names[mode].kind, units)).read(source);
    });
  }
  in.finish();
  return assemble_fabric(std::move(parts), source);
}

void write_fabric(const std::string& path, const Fabric& fabric) {
  if (text::lower_extension(path) != ".json") {
    throw InvalidInput(path + ": fabrics are written as .json");
  }
  AtomicFile file(path);
  file.stream() << fabric_text(fabric);
  file.commit();
}

}  // namespace semblance
