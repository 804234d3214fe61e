#include "semblance/cloth/scene_io.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>

#include "semblance/cloth/fabric_io.h"
#include "semblance/cloth/presets.h"
#include "semblance/core/errors.h"
#include "semblance/io/gltf_skin.h"
#include "semblance/io/json_file.h"
#include "semblance/io/json_reader.h"
#include "semblance/io/mesh_io.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr double degree = std::numbers::pi / 180.0;
constexpr double largest_m = 1e3;
constexpr double smallest_scale = 1e-6, largest_scale = 1e6;  // of bodies' files
constexpr std::size_t most_obstacles = 1000;
constexpr int most_frames = 100000;

/// Held vertices: by number, or all whose (u, v) lie in a rectangle.
struct Hold {
  std::vector<int> vertices;
  bool region = false;
  Eigen::Vector2d u_m{-largest_m, largest_m}, v_m{-largest_m, largest_m};
};

/// A scene as the file has it, before a spacing is chosen.
struct SceneFile {
  std::string path, kind;
  double warp_m = 0.0, weft_m = 0.0, radius_m = 0.0;
  double spacing_m = 0.01;
  std::shared_ptr<const Sheet> sheet;  // of a mesh
  Points sheet_m;                      // its vertices in space
  Rigid3 place;
  Fabric fabric;
  SheetModel model;
  std::vector<Hold> holds;
  std::vector<Obstacle> obstacles;
  Vector3d gravity_m_s2{0.0, -9.80665, 0.0};
  bool self_contact = true;
};

/// "translation_m" and "turn_deg", a rotation about a vector by as many degrees as it is long.
Rigid3 read_place(JsonReader& in) {
  Rigid3 place;
  Vector3d turn_deg = Vector3d::Zero();
  in.vector("translation_m", place.translation_m);
  in.vector("turn_deg", turn_deg);
  place.rotation = quaternion_from_rotation_vector(turn_deg * degree);
  return place;
}

/// A file that the scene names.
template <typename T>
T read_named(const fs::path& folder, const std::string& file, T (*read)(const std::string&)) {
  try {
    return read((folder / file).string());
  } catch (const IoError& error) {
    throw IoError(fmt::format("{}; a scene's files are found from its own folder, {}", error.what(),
                              folder.empty() ? "." : folder.string()));
  }
}

/// Length of all sides in space over that in the fabric. Cloth gives little along its yarns, so
/// that whatever shape it starts in, this is near 1.
double length_ratio(const Sheet& sheet, const Points& positions_m) {
  double in_space_m = 0.0, in_fabric_m = 0.0;
  for (Eigen::Index t = 0; t < sheet.triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int a = sheet.triangles(t, k), b = sheet.triangles(t, (k + 1) % 3);
      in_space_m += (positions_m.row(a) - positions_m.row(b)).norm();
      in_fabric_m += (sheet.material_m.row(a) - sheet.material_m.row(b)).norm();
    }
  }
  return in_space_m / in_fabric_m;
}

/// Texture coordinates are mostly made for pictures, and from 0 to 1.
void check_lengths(const Sheet& sheet, const Points& positions_m, const std::string& path) {
  constexpr double longest = 1.25;
  const double ratio = length_ratio(sheet, positions_m);
  if (ratio <= longest && ratio >= 1.0 / longest) return;
  throw InvalidInput(fmt::format(
      "{}: the sheet's sides are on the whole {:.4g} times as long in space as in its texture "
      "coordinates; both must be in metres: multiply the texture coordinates by {:.4g}, or the "
      "positions by {:.4g}",
      path, ratio, ratio, 1.0 / ratio));
}

void read_sheet(JsonReader& in, const fs::path& folder, SceneFile& scene) {
  in.text("kind", scene.kind);
  if (scene.kind == "rectangle") {
    if (in.required("warp_m")) in.number("warp_m", scene.warp_m, 1e-4, 100.0);
    if (in.required("weft_m")) in.number("weft_m", scene.weft_m, 1e-4, 100.0);
  } else if (scene.kind == "disc") {
    if (in.required("radius_m")) in.number("radius_m", scene.radius_m, 1e-4, 100.0);
  } else if (scene.kind == "mesh") {
    std::string file;
    in.require("file");
    in.text("file", file);
    in.check();
    const std::string path = (folder / file).string();
    const Mesh mesh = read_named(folder, file, read_mesh);
    scene.sheet = std::make_shared<Sheet>(make_sheet(mesh, path));
    scene.sheet_m = mesh.positions_m;
    check_lengths(*scene.sheet, scene.sheet_m, path);
  } else {
    in.fail("kind", "rectangle, disc or mesh");
  }
  if (scene.kind != "mesh") in.number("spacing_m", scene.spacing_m, 1e-5, 10.0);
  in.group("placement", [&](JsonReader& inner) { scene.place = read_place(inner); });
}

Hold read_hold(JsonReader& in) {
  Hold hold;
  if (const auto* list = in.find("vertices"); list != nullptr) {
    if (!list->is_array()) in.fail("vertices", "a list of vertices, numbered from 1");
    for (const auto& entry : *list) {
      if (!entry.is_number_integer() || entry.get<std::int64_t>() < 1 ||
          entry.get<std::int64_t>() > (std::int64_t{1} << 30)) {
        in.fail("vertices", "a list of vertices, numbered from 1");
      }
      hold.vertices.push_back(entry.get<int>() - 1);
    }
  }
  hold.region = in.find("u_m") != nullptr || in.find("v_m") != nullptr;
  in.vector("u_m", hold.u_m);
  in.vector("v_m", hold.v_m);
  if (hold.region == !hold.vertices.empty()) {
    in.problem("vertices", "either these, or a region by \"u_m\" and \"v_m\" (from, to)");
  }
  return hold;
}

/// "walk_####.obj" with as many digits; the empty name where there is no #.
std::string sequence_name(const std::string& pattern, int number) {
  const std::size_t first = pattern.find('#');
  if (first == std::string::npos) return "";
  std::size_t last = first;
  while (last < pattern.size() && pattern[last] == '#') ++last;
  return pattern.substr(0, first) + fmt::format("{:0{}}", number, last - first) +
         pattern.substr(last);
}

Obstacle read_sequence(JsonReader& in, const std::string& name, const fs::path& folder) {
  std::string pattern;
  int first = 0;
  double fps = 25.0, scale = 1.0;
  in.require("files");
  in.text("files", pattern);
  in.number("scale", scale, smallest_scale, largest_scale);
  in.number("first", first, 0, 1e9);
  in.number("fps", fps, 1e-3, 1e5);
  in.check();
  if (sequence_name(pattern, first).empty()) {
    in.fail("files", "a name with # for each digit of the frame's number, such as walk_####.obj");
  }
  std::vector<double> times_s;
  std::vector<Points> frames_m;
  Obstacle body;
  for (int k = 0; k < most_frames; ++k) {
    const std::string path = (folder / sequence_name(pattern, first + k)).string();
    if (!fs::exists(path)) break;
    Mesh mesh = read_mesh(path);
    mesh.positions_m *= scale;
    if (k == 0) body = make_mesh_obstacle(name, mesh);
    if (mesh.vertex_count() != body.surface->vertex_count() ||
        mesh.triangles.rows() != body.surface->triangles.rows() ||
        mesh.triangles != body.surface->triangles) {
      throw InvalidInput(path + ": its triangles are not those of the sequence's first file");
    }
    times_s.push_back(k / fps);
    frames_m.push_back(mesh.positions_m);
  }
  if (frames_m.empty()) {
    throw InvalidInput(fmt::format("{}: there is no first file of the sequence {}",
                                   (folder / sequence_name(pattern, first)).string(), pattern));
  }
  body.vertices = vertex_frames(std::move(times_s), std::move(frames_m));
  return body;
}

Obstacle read_mesh_body(JsonReader& in, const std::string& name, const fs::path& folder) {
  std::string file;
  double scale = 1.0;
  in.require("file");
  in.text("file", file);
  in.number("scale", scale, smallest_scale, largest_scale);
  const Rigid3 place = read_place(in);
  in.check();
  Mesh mesh = read_named(folder, file, read_mesh);
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) {
    mesh.positions_m.row(v) = (place * Vector3d(scale * mesh.positions_m.row(v))).transpose();
  }
  return make_mesh_obstacle(name, std::move(mesh));
}

/// "animation": its name, or its number from 0, or false for the body at rest; the first where it
/// is not given. Null for rest.
const SkinAnimation* read_animation(JsonReader& in, const std::vector<SkinAnimation>& animations) {
  const nlohmann::json* entry = in.find("animation");
  if (entry == nullptr) return animations.empty() ? nullptr : animations.data();
  if (*entry == false) return nullptr;
  std::string names;
  for (std::size_t k = 0; k < animations.size(); ++k) {
    if (*entry == animations[k].name || *entry == k) return &animations[k];
    if (k < 20) names += fmt::format(", {} ({})", k, text::quoted(animations[k].name));
  }
  in.fail("animation", "false" + names + ": the animations that the file has");
}

Obstacle read_skinned_mesh(JsonReader& in, const std::string& name, const fs::path& folder) {
  std::string file;
  double scale = 1.0, fps = 30.0;
  in.require("file");
  in.text("file", file);
  in.number("scale", scale, smallest_scale, largest_scale);
  in.number("fps", fps, 1e-3, 1e5);
  const Rigid3 place = read_place(in);
  in.check();
  const SkinnedMesh skin = read_named(folder, file, read_gltf_skin);
  const SkinAnimation* animation = read_animation(in, skin.animations);
  Eigen::Affine3d world_from_skin(Eigen::Translation3d(place.translation_m) * place.rotation);
  world_from_skin.scale(scale);
  const std::string source = fmt::format("{} ({})", name, (folder / file).string());
  Obstacle body = make_skin_obstacle(source, skin, animation, fps, world_from_skin);
  body.name = name;
  return body;
}

Obstacle read_plane(JsonReader& in, const std::string& name) {
  Vector3d point = Vector3d::Zero(), normal = Vector3d::UnitY();
  in.vector("point_m", point);
  in.vector("normal", normal);
  in.check();
  if (!(normal.norm() > 1e-9)) in.fail("normal", "a vector that is not zero");
  return make_plane(name, point, normal.normalized());
}

Obstacle read_box(JsonReader& in, const std::string& name) {
  Vector3d size = Vector3d::Zero();
  double rounding_m = 0.0;
  in.required("size_m");
  in.vector("size_m", size);
  in.number("rounding_m", rounding_m, 0.0, 10.0);
  const Rigid3 place = read_place(in);
  in.check();
  if (!(size.minCoeff() > 0.0) || 2.0 * rounding_m >= size.minCoeff()) {
    in.fail("size_m", "three positive sides, each more than twice the rounding");
  }
  return make_box(name, size, place, rounding_m);
}

std::vector<Obstacle> read_tester(JsonReader& in, const std::string& name) {
  Vector3d top = Vector3d::Zero();
  DrapeTester tester;
  in.vector("top_centre_m", top);
  in.number("disc_radius_m", tester.disc_radius_m, 1e-3, 10.0);
  in.number("disc_thickness_m", tester.disc_thickness_m, 1e-4, 1.0);
  in.number("stem_radius_m", tester.stem_radius_m, 1e-4, 10.0);
  in.number("stem_length_m", tester.stem_length_m, 1e-3, 100.0);
  in.number("sides", tester.sides, 3, 4096);
  in.check();
  return make_drape_tester(name, top, tester);
}

Obstacle read_sphere(JsonReader& in, const std::string& name) {
  double radius_m = 0.1;
  in.required("radius_m");
  in.number("radius_m", radius_m, 1e-4, 100.0);
  const Rigid3 place = read_place(in);
  in.check();
  return make_sphere(name, radius_m, place);
}

void read_obstacle(JsonReader& in, std::size_t index, const fs::path& folder,
                   std::vector<Obstacle>& out) {
  if (index >= most_obstacles) in.fail("kind", "at most 1000 obstacles");
  std::string kind, name;
  in.text("kind", kind);
  in.text("name", name);
  if (name.empty()) name = kind + " " + std::to_string(index + 1);
  if (kind == "plane") return out.push_back(read_plane(in, name));
  if (kind == "box") return out.push_back(read_box(in, name));
  if (kind == "sphere") return out.push_back(read_sphere(in, name));
  if (kind == "mesh") return out.push_back(read_mesh_body(in, name, folder));
  if (kind == "mesh_sequence") return out.push_back(read_sequence(in, name, folder));
  if (kind == "skinned_mesh") return out.push_back(read_skinned_mesh(in, name, folder));
  if (kind != "drape_tester") {
    in.fail("kind", "plane, box, sphere, drape_tester, mesh, mesh_sequence or skinned_mesh");
  }
  for (Obstacle& obstacle : read_tester(in, name)) out.push_back(std::move(obstacle));
}

// ---- from the file's contents to a scene

Sheet make_scene_sheet(const SceneFile& scene, double spacing_m) {
  if (scene.kind == "mesh") return *scene.sheet;
  if (scene.kind == "disc") return make_disc(scene.radius_m, spacing_m);
  return make_rectangle(scene.warp_m, scene.weft_m, spacing_m);
}

Points start_of(const SceneFile& scene, const Sheet& sheet) {
  Points start = scene.sheet_m;
  if (scene.kind != "mesh") {
    start = lay_flat(sheet, {-0.5 * scene.warp_m, 0.0, 0.5 * scene.weft_m});
  }
  for (Eigen::Index v = 0; v < start.rows(); ++v) {
    start.row(v) = (scene.place * Vector3d(start.row(v))).transpose();
  }
  return start;
}

std::vector<int> held(const SceneFile& scene, const Sheet& sheet) {
  std::vector<bool> flags(sheet.vertex_count(), false);
  for (std::size_t k = 0; k < scene.holds.size(); ++k) {
    const Hold& hold = scene.holds[k];
    const auto fail = [&](const std::string& what) {
      throw InvalidInput(fmt::format("{}: fixed[{}]: {}", scene.path, k, what));
    };
    bool any = false;
    for (const int v : hold.vertices) {
      if (v >= sheet.vertex_count()) {
        fail(fmt::format("vertex {} of {}", v + 1, sheet.vertex_count()));
      }
      flags[v] = any = true;
    }
    const double slack_m = 1e-9;
    for (Eigen::Index v = 0; hold.region && v < sheet.vertex_count(); ++v) {
      const Eigen::RowVector2d p = sheet.material_m.row(v);
      if (p.x() < hold.u_m[0] - slack_m || p.x() > hold.u_m[1] + slack_m) continue;
      if (p.y() < hold.v_m[0] - slack_m || p.y() > hold.v_m[1] + slack_m) continue;
      flags[v] = any = true;
    }
    if (!any) fail("no vertex lies in this region; make it wider or the spacing smaller");
  }
  std::vector<int> out;
  for (std::size_t v = 0; v < flags.size(); ++v) {
    if (flags[v]) out.push_back(static_cast<int>(v));
  }
  return out;
}

ClothScene make_scene(const SceneFile& file, double spacing_m) {
  ClothScene scene;
  try {
    scene.sheet = make_scene_sheet(file, spacing_m);
  } catch (const InvalidInput& error) {
    throw InvalidInput(file.path + ": " + error.what());
  }
  scene.fabric = file.fabric;
  scene.model = file.model;
  scene.start_m = start_of(file, scene.sheet);
  scene.fixed = held(file, scene.sheet);
  scene.obstacles = file.obstacles;
  scene.self_contact = file.self_contact;
  scene.gravity_m_s2 = file.gravity_m_s2;
  return scene;
}

void read_model(JsonReader& in, SceneFile& scene) {
  std::string model = "default";
  bool hysteresis = true;
  in.text("model", model);
  in.flag("hysteresis", hysteresis);
  try {
    scene.model = make_sheet_model(model, hysteresis);
  } catch (const InvalidInput& error) {
    in.problem("model", error.what());
  }
}

/// The file and, behind the last colon, a name in it: only the former is relative to the scene.
Fabric scene_fabric(JsonReader& in, const fs::path& folder, const std::string& instead) {
  std::string from;
  in.text("fabric", from);
  if (!instead.empty()) return read_fabric(instead);
  if (from.empty()) in.fail("fabric", "a file of a fabric (or give --fabric)");
  return read_fabric((folder / from).string());
}

}  // namespace

SimulationSetup read_cloth_scene(const std::string& path, const std::string& fabric) {
  const nlohmann::json json = read_json_file(path);
  const fs::path folder = fs::path(path).parent_path();
  JsonReader in(json, path);
  std::string schema;
  in.text("schema", schema);
  if (schema != "semblance.cloth_scene/1") in.fail("schema", "\"semblance.cloth_scene/1\"");
  auto scene = std::make_shared<SceneFile>();
  scene->path = path;
  read_model(in, *scene);
  in.flag("self_contact", scene->self_contact);
  in.vector("gravity_m_s2", scene->gravity_m_s2);
  in.require("sheet");
  in.group("sheet", [&](JsonReader& inner) { read_sheet(inner, folder, *scene); });
  in.list("fixed",
          [&](JsonReader& inner, std::size_t) { scene->holds.push_back(read_hold(inner)); });
  in.list("obstacles", [&](JsonReader& inner, std::size_t index) {
    read_obstacle(inner, index, folder, scene->obstacles);
  });
  scene->fabric = scene_fabric(in, folder, fabric);
  in.finish();

  SimulationSetup setup;
  setup.name = path;
  setup.spacing_m = scene->spacing_m;
  setup.has_spacing = scene->kind != "mesh";
  setup.make = [scene](double spacing_m) { return make_scene(*scene, spacing_m); };
  return setup;
}

}  // namespace semblance
