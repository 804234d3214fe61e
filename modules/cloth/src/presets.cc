#include "semblance/cloth/presets.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <functional>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

constexpr double drape_disc_radius_m = 0.09, drape_specimen_radius_m = 0.15;  // ISO 9073-9

/// Between cloth and support at the start, in thicknesses: within the reach of contact forces.
constexpr double start_gap = 0.8;

ClothScene table_scene(double spacing_m, const Fabric& fabric, int) {
  constexpr double warp_m = 1.0, weft_m = 0.8, height_m = 0.7;
  ClothScene scene;
  scene.sheet = make_rectangle(warp_m, weft_m, spacing_m);
  scene.start_m = lay_flat(
      scene.sheet, {0.05 - 0.5 * warp_m, start_gap * fabric.thickness_m, 0.5 * weft_m + 0.04});
  Rigid3 place;
  place.translation_m.y() = -0.5 * height_m;
  scene.obstacles = {make_box("table", {0.6, height_m, 0.5}, place)};
  return scene;
}

ClothScene pinned_scene(double spacing_m, const Fabric&, int) {
  ClothScene scene;
  scene.sheet = make_rectangle(1.0, 1.0, spacing_m);
  scene.start_m = lay_flat(scene.sheet, {-0.5, 0.0, 0.5});
  const SheetGrid& grid = *scene.sheet.grid;
  scene.fixed = {grid.vertex(0, grid.rows - 1), grid.vertex(grid.columns - 1, grid.rows - 1)};
  return scene;
}

/// The sheet's free edge comes down before the box and swings against its upper front edge.
ClothScene pinned_box_scene(double spacing_m, const Fabric& fabric, int start) {
  ClothScene scene = pinned_scene(spacing_m, fabric, start);
  Rigid3 place;
  place.translation_m = {0.0, -0.85, -0.4};
  scene.obstacles = {make_box("box", {0.4, 0.5, 0.3}, place)};
  return scene;
}

/// The tester clamps the specimen between two discs, so what lies on the disc is held.
/// No specimen is quite flat, and a flat start, the same on all sides, leaves it to the mesh where
/// folds appear. Waves around the overhang, outwards from the clamp; the same on every mesh.
void add_dents(ClothScene& scene, int start) {
  constexpr int most_waves = 8;
  constexpr double height_m = 1e-3;
  Random random(static_cast<std::uint64_t>(start));
  std::array<std::array<double, 2>, most_waves> waves;
  for (auto& wave : waves) wave = {random.normal(), random.normal()};
  for (Eigen::Index v = 0; v < scene.sheet.vertex_count(); ++v) {
    const Eigen::Vector2d p = scene.sheet.material_m.row(v);
    const double angle = std::atan2(p.y(), p.x());
    const double out = std::max(
        0.0, (p.norm() - drape_disc_radius_m) / (drape_specimen_radius_m - drape_disc_radius_m));
    double height = 0.0;
    for (int k = 0; k < most_waves; ++k)
      height += waves[k][0] * std::cos(k * angle) + waves[k][1] * std::sin(k * angle);
    scene.start_m(v, 1) += height_m * out * out * height / std::sqrt(most_waves);
  }
}

ClothScene disc_scene(double spacing_m, const Fabric& fabric, int start) {
  ClothScene scene;
  scene.sheet = make_disc(drape_specimen_radius_m, spacing_m, drape_disc_radius_m);
  scene.start_m = lay_flat(scene.sheet, {0.0, start_gap * fabric.thickness_m, 0.0});
  add_dents(scene, start);
  for (Eigen::Index v = 0; v < scene.sheet.vertex_count(); ++v) {
    if (scene.sheet.material_m.row(v).norm() <= drape_disc_radius_m * (1.0 + 1e-9)) {
      scene.fixed.push_back(static_cast<int>(v));
    }
  }
  scene.obstacles = make_drape_tester("drape tester", Eigen::Vector3d::Zero(),
                                      {.disc_radius_m = drape_disc_radius_m});
  return scene;
}

/// Two columns of vertices are held: bending begins at the second, where u = 0 and x = 0.
ClothScene strip_scene(double spacing_m, const Fabric&, int) {
  constexpr double free_m = 0.2, width_m = 0.02;
  const double along_m = free_m / std::max(1.0, std::round(free_m / spacing_m));
  ClothScene scene;
  scene.sheet = make_rectangle(free_m + along_m, width_m, along_m);
  const SheetGrid& grid = *scene.sheet.grid;
  scene.sheet.material_m.col(0).array() -= grid.warp_spacing_m;
  scene.start_m = lay_flat(scene.sheet, {0.0, 0.0, 0.5 * width_m});
  for (int j = 0; j < grid.rows; ++j) {
    for (const int i : {0, 1}) scene.fixed.push_back(grid.vertex(i, j));
  }
  return scene;
}

struct Preset {
  const char* name;
  double spacing_m;
  ClothScene (*make)(double spacing_m, const Fabric&, int start);
};

constexpr double swatch_spacing_m = 1.0 / 99.0;  // 100 x 100 particles

const Preset presets[] = {
    {"table", 0.01, table_scene},
    {"pinned", swatch_spacing_m, pinned_scene},
    {"pinned-box", swatch_spacing_m, pinned_box_scene},
    {"disc", 0.005, disc_scene},
    {"strip", 0.005, strip_scene},
};

const Preset& find_preset(const std::string& name) {
  std::string list;
  for (const Preset& preset : presets) {
    if (preset.name == name) return preset;
    list += (list.empty() ? "" : ", ") + std::string(preset.name);
  }
  throw InvalidInput(
      fmt::format("'{}' is neither a file nor a preset; presets are {}", name, list));
}

}  // namespace

std::vector<std::string> preset_names() {
  std::vector<std::string> names;
  for (const Preset& preset : presets) names.emplace_back(preset.name);
  return names;
}

ClothScene make_preset(const std::string& name, double spacing_m, const Fabric& fabric, int start) {
  const Preset& preset = find_preset(name);
  if (!(spacing_m > 0.0)) {
    throw InvalidInput(fmt::format("{}: the spacing must be positive, not {} m", name, spacing_m));
  }
  try {
    ClothScene scene = preset.make(spacing_m, fabric, start);
    scene.fabric = fabric;
    return scene;
  } catch (const InvalidInput& error) {
    throw InvalidInput(name + ": " + error.what());
  }
}

SimulationSetup preset_setup(const std::string& name, const Fabric& fabric, int start) {
  SimulationSetup setup;
  setup.name = name;
  setup.spacing_m = find_preset(name).spacing_m;
  setup.make = [name, fabric, start](double spacing_m) {
    return make_preset(name, spacing_m, fabric, start);
  };
  if (name == "disc") {
    setup.drape = DrapeTest{.disc_radius_m = drape_disc_radius_m};
  }
  return setup;
}

SheetModel make_sheet_model(const std::string& name, bool hysteresis) {
  SheetModel model;
  model.internal_friction = hysteresis ? InternalFriction::incremental : InternalFriction::none;
  if (name == "choi-ko") {
    model.bending = BendingModel::interlaced;
    model.compression = CompressionLaw::none;
  } else if (name == "as-tension") {
    model.compression = CompressionLaw::as_tension;
  } else if (name != "default") {
    throw InvalidInput("'" + name +
                       "' is no model of a sheet; models are default, choi-ko, as-tension");
  }
  return model;
}

Points lay_flat(const Sheet& sheet, const Eigen::Vector3d& origin_m) {
  Points out(sheet.vertex_count(), 3);
  out.col(0) = sheet.material_m.col(0).array() + origin_m.x();
  out.col(1).setConstant(origin_m.y());
  out.col(2) = origin_m.z() - sheet.material_m.col(1).array();
  return out;
}

}  // namespace semblance
