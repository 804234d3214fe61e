#include "semblance/synth/generate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <optional>

#include "backdrop.h"
#include "head.h"
#include "noise.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/image_io.h"
#include "semblance/io/lip_markers.h"
#include "semblance/io/track_file.h"
#include "semblance/models/face.h"
#include "semblance/models/load_face.h"
#include "semblance/synth/motion.h"
#include "semblance/synth/sensor.h"
#include "tracer.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3f;

constexpr double kHandTravel = 0.4;          // seconds the hand takes to rise and to sink
constexpr float kHiddenBehindM = 0.006f;     // a landmark this far behind what is seen is hidden
constexpr float kDotHiddenBehindM = 0.002f;  // lips hide their own dots at a smaller distance
constexpr double kFingersBackM = 0.062;      // puts the finger tips before half of the mouth

MorphShape load_model(const FaceClipSpec& spec) {
  if (spec.model == "builtin") return make_sweep_face({spec.density});
  return load_face(resolve_model(spec));
}

Camera clip_camera(const FaceClipSpec& spec) {
  return Camera::centred(spec.width, spec.height, spec.focal_px);
}

// A room with a brighter side and one lamp, exposed so that the face comes out in the mid-tones.
Lighting draw_lighting(const FaceClipSpec& spec, const PersonLook& look, Random& random,
                       float& exposure) {
  const Vector3f luma(0.2126f, 0.7152f, 0.0722f);
  const float albedo = luma.dot(skin_albedo(look.skin_tone));
  // A camera's automatic exposure lifts a dark face, though not all the way.
  exposure = 0.36f / std::pow(albedo, 0.7f) / std::pow(0.36f, 0.3f);
  const auto key = static_cast<float>(spec.look.key_light);
  const double azimuth = random.uniform(-1.05, 1.05), height = random.uniform(0.2, 0.9);
  const auto warmth = static_cast<float>(random.uniform(-0.12, 0.12));
  Lighting lighting;
  lighting.lamp_direction = Vector3f(static_cast<float>(std::sin(azimuth) * std::cos(height)),
                                     static_cast<float>(std::sin(height)),
                                     static_cast<float>(std::cos(azimuth) * std::cos(height)));
  lighting.lamp_colour = exposure * key * 1.15f * Vector3f(1 + warmth, 1.0f, 1 - warmth);
  const Vector3f sky =
      exposure * (1 - 0.75f * key) * Vector3f(1 - 0.5f * warmth, 1.0f, 1 + 0.5f * warmth);
  const auto side = static_cast<float>(random.uniform(-0.3, 0.3));
  lighting.sky.coefficients[0] = 0.9f * sky;
  lighting.sky.coefficients[1] = 0.22f * sky;  // from above
  lighting.sky.coefficients[2] = 0.15f * sky;  // from the front: a screen, a window
  lighting.sky.coefficients[3] = side * sky;
  return lighting;
}

// How far a hand is up that is held before the mouth from `from_s` to `to_s`.
double raised(double from_s, double to_s, double time_s) {
  if (to_s <= from_s) return 0.0;
  const auto step = [](double t) { return smooth_step(0.0f, 1.0f, static_cast<float>(t)); };
  return step((time_s - from_s + kHandTravel) / kHandTravel) *
         step((to_s + kHandTravel - time_s) / kHandTravel);
}

/// All that is fixed during a clip.
struct Stage {
  FaceClipSpec spec;
  Camera camera;
  PersonLook look;
  std::shared_ptr<const MorphModel> model;
  std::optional<SynthHead> head;
  std::optional<FaceMotion> motion;
  std::optional<Backdrop> backdrop;
  Lighting lighting;
  std::vector<Surface> surfaces;

  explicit Stage(const FaceClipSpec& given) : spec(given), camera(clip_camera(given)) {
    Random person(spec.seed, 21), light(spec.seed, 22);
    look = draw_person(person, spec.look.skin_tone, spec.look.stubble);
    model = std::make_shared<const MorphModel>(MorphModel(load_model(spec)));
    // Three texels or more per pixel at the closest approach.
    const double closest_m = spec.motion.distance_m - spec.motion.distance_range_m - 0.05;
    head.emplace(model, look, spec.markers, 0.33 * std::max(0.05, closest_m) / spec.focal_px,
                 spec.model);
    motion.emplace(spec, *model);
    float exposure = 1;
    lighting = draw_lighting(spec, look, light, exposure);
    backdrop.emplace(spec.width, spec.height, spec.look.clutter, 0.65f * exposure,
                     skin_albedo(look.skin_tone), Random(spec.seed, 23));
    surfaces = head->surfaces();
    surfaces.resize(surfaces.size() + 2, {0.04f, 14.0f, 0.18f, {}});  // hands
  }

  Scene scene_at(double time_s) const {
    Scene scene;
    const Eigen::VectorXd x = motion->at(time_s);
    head->pose(x, scene);
    const OcclusionSpec& o = spec.occlusion;
    add_hand(x, raised(o.hand_from_s, o.hand_to_s, time_s), 0.0, scene);
    add_hand(x, raised(o.fingers_from_s, o.fingers_to_s, time_s), kFingersBackM, scene);
    return scene;
  }

  void add_hand(const Eigen::VectorXd& x, double up, double drawn_back_m, Scene& scene) const {
    if (up <= 0) return;
    const auto marks = head->landmarks(x);
    const Rigid3 pose{Eigen::Quaterniond(x[0], x[1], x[2], x[3]), x.segment<3>(4)};
    scene.objects.push_back(make_hand(pose, 0.5 * (marks[62] + marks[66]), up, drawn_back_m,
                                      skin_albedo(look.skin_tone)));
  }

  std::vector<Eigen::Vector2d> lip_markers_px(double time_s) const {
    std::vector<Eigen::Vector2d> out;
    for (const Eigen::Vector3d& place : head->lip_markers(motion->at(time_s)))
      out.push_back(project_world(camera, place));
    return out;
  }
};

struct MadeFrame {
  Rgb8 picture;
  TrackFrame truth;
  LipFrame lips;
};

bool inside(const Camera& camera, const Eigen::Vector2d& p) {
  return p.x() >= 0 && p.y() >= 0 && p.x() < camera.width && p.y() < camera.height;
}

// Seen: in the picture, and nothing in front of it in the 3x3 pixels around (the deepest counts, as
// a landmark on a silhouette shares its pixel with what is before or behind).
bool visible(const Camera& camera, const Image& depth, const Eigen::Vector2d& p, double z_m,
             float hidden_behind_m) {
  if (!inside(camera, p)) return false;
  const int x = static_cast<int>(p.x()), y = static_cast<int>(p.y());
  float deepest = 0;
  for (int j = std::max(0, y - 1); j <= std::min(camera.height - 1, y + 1); ++j)
    for (int i = std::max(0, x - 1); i <= std::min(camera.width - 1, x + 1); ++i)
      deepest = std::max(deepest, *depth.pixel(i, j));
  return deepest == 0 || z_m < deepest + hidden_behind_m;
}

TrackFrame truth_at(const Stage& stage, int frame, const Image& depth) {
  TrackFrame truth;
  truth.frame = frame;
  truth.time_s = frame / stage.spec.frames_per_second;
  truth.status = TrackStatus::tracked;
  truth.x = stage.motion->at(truth.time_s);
  truth.sigma = Eigen::VectorXd::Zero(truth.x.size());
  truth.rotation_wxyz = truth.x.head<4>();
  truth.translation_m = truth.x.segment<3>(4);
  truth.inlier_fraction = 1.0;
  std::vector<int> seen;
  int within = 0;
  for (const Eigen::Vector3d& mark : stage.head->landmarks(truth.x)) {
    const Eigen::Vector3d in_camera = stage.camera.camera_from_world * mark;
    const Eigen::Vector2d p = project(stage.camera, in_camera);
    truth.landmarks_px.push_back(p);
    seen.push_back(visible(stage.camera, depth, p, in_camera.z(), kHiddenBehindM) ? 1 : 0);
    within += inside(stage.camera, p) ? 1 : 0;
  }
  truth.extra = nlohmann::json::object();
  truth.extra["landmarks_visible"] = seen;
  truth.extra["interocular_px"] = (truth.landmarks_px[45] - truth.landmarks_px[36]).norm();
  truth.extra["in_picture"] = 2 * within >= static_cast<int>(truth.landmarks_px.size());
  return truth;
}

// A hidden marker's place is known here all the same: it counts as bridged.
LipFrame true_lips_at(const Stage& stage, int frame, const Image& depth) {
  constexpr double kStepS = 1e-4;  // of the central difference that velocities come from
  LipFrame lips;
  lips.frame = frame;
  lips.time_s = frame / stage.spec.frames_per_second;
  lips.confidence = 1.0;
  const auto before = stage.lip_markers_px(lips.time_s - kStepS),
             after = stage.lip_markers_px(lips.time_s + kStepS);
  for (const Eigen::Vector3d& place : stage.head->lip_markers(stage.motion->at(lips.time_s))) {
    const Eigen::Vector3d in_camera = stage.camera.camera_from_world * place;
    const std::size_t i = lips.markers.size();
    LipMarker marker;
    marker.position_px = project(stage.camera, in_camera);
    marker.velocity_px_s = (after[i] - before[i]) / (2 * kStepS);
    marker.state =
        visible(stage.camera, depth, marker.position_px, in_camera.z(), kDotHiddenBehindM)
            ? MarkerState::seen
            : MarkerState::bridged;
    lips.markers.push_back(marker);
  }
  return lips;
}

void add_over(const Traced& traced, const Image& behind, float weight, Image& sum) {
  const std::size_t pixels = static_cast<std::size_t>(sum.width) * sum.height;
  for (std::size_t i = 0; i < pixels; ++i) {
    const float* front = traced.rgba.data.data() + 4 * i;
    for (int c = 0; c < 3; ++c)
      sum.data[3 * i + c] += weight * (front[c] + (1 - front[3]) * behind.data[3 * i + c]);
  }
}

MadeFrame make_frame(const Stage& stage, int frame) {
  const SensorSpec& sensor = stage.spec.sensor;
  const double time_s = frame / stage.spec.frames_per_second;
  Image light(stage.spec.width, stage.spec.height, 3);
  Image depth;
  Tracer tracer;
  for (int sub = 0; sub < sensor.sub_frames; ++sub) {
    const double shift = sensor.exposure_s * ((sub + 0.5) / sensor.sub_frames - 0.5);
    const Scene scene = stage.scene_at(time_s + shift);
    tracer.set_scene(scene, stage.surfaces);
    Traced traced = tracer.trace(stage.camera, stage.lighting, sensor.samples);
    add_over(traced, stage.backdrop->at(time_s + shift),
             1.0f / static_cast<float>(sensor.sub_frames), light);
    if (sub == sensor.sub_frames / 2) depth = std::move(traced.depth);
  }
  blur_gaussian(light, sensor.lens_blur_px);
  return {expose(light, sensor, stage.spec.seed, frame), truth_at(stage, frame, depth),
          true_lips_at(stage, frame, depth)};
}

TrackHeader truth_header(const Stage& stage) {
  TrackHeader header;
  header.kind = "face";
  header.seed = stage.spec.seed;
  header.parameters = stage.model->parameters();
  header.cameras = {stage.camera};
  header.width = stage.spec.width;
  header.height = stage.spec.height;
  for (const ModelLandmark& mark : stage.model->landmarks())
    header.landmark_names.push_back(mark.name);
  header.config = {{"truth", true}, {"clip", nlohmann::json::parse(clip_spec_json(stage.spec))}};
  return header;
}

std::string video_name(const FaceClipSpec& spec) {
  return spec.output == "png" ? "frames" : "clip." + spec.output;
}

std::string frame_name(int frame) { return fmt::format("{:06d}.png", frame); }

void render_all(const Stage& stage, const fs::path& folder, Progress& progress) {
  const FaceClipSpec& spec = stage.spec;
  std::optional<VideoWriter> video;
  if (spec.output == "png")
    fs::create_directories(folder / "frames");
  else
    video.emplace((folder / video_name(spec)).string(), spec.width, spec.height,
                  spec.frames_per_second);
  TrackWriter truth((folder / "truth.jsonl").string(), truth_header(stage));
  LipTrack lips{spec.markers.count, {}};
  progress.begin("clip " + spec.name, spec.frames);
  const int batch = 4 * std::max(1, thread_count());
  for (int first = 0; first < spec.frames; first += batch) {
    if (progress.cancelled())
      throw SolverError("generation of clip " + spec.name + " was cancelled");
    std::vector<MadeFrame> made(std::min(batch, spec.frames - first));
    parallel_for(made.size(), [&](std::size_t i) {
      const int frame = first + static_cast<int>(i);
      made[i] = make_frame(stage, frame);
      if (!video)
        write_image((folder / "frames" / frame_name(frame)).string(),
                    linear_from_rgb8(made[i].picture));
    });
    for (const MadeFrame& frame : made) {
      if (video) video->write(frame.picture);
      truth.write(frame.truth);
      lips.frames.push_back(frame.lips);
    }
    progress.update(first + static_cast<int>(made.size()));
  }
  if (video) video->close();
  if (lips.marker_count > 0) write_lip_markers((folder / "lips.csv").string(), lips);
  progress.end();
}

void check_folder(const fs::path& folder) {
  if (!fs::exists(folder)) return;
  if (!fs::is_directory(folder))
    throw InvalidInput(folder.string() + ": is a file; expected a folder");
  if (!fs::is_empty(folder) && !fs::exists(folder / "spec.json"))
    throw InvalidInput(folder.string() + ": holds other files; give a new or empty folder");
}

}  // namespace

ClipFiles generate_clip(const FaceClipSpec& spec, const std::string& folder_name,
                        Progress& progress) {
  const fs::path folder = fs::path(folder_name).lexically_normal();
  check_folder(folder);
  fs::path partial = folder;
  if (!partial.has_filename()) partial = partial.parent_path();
  const fs::path final_folder = partial;
  partial += ".partial";
  std::error_code error;
  fs::remove_all(partial, error);
  fs::create_directories(partial, error);
  if (error) throw IoError(partial.string() + ": " + error.message());
  try {
    const Stage stage(spec);
    render_all(stage, partial, progress);
    write_camera((partial / "camera.json").string(), stage.camera);
    std::ofstream recipe(partial / "spec.json");
    recipe << clip_spec_json(spec) << '\n';
    recipe.close();
    if (!recipe) throw IoError((partial / "spec.json").string() + ": cannot be written");
    fs::remove_all(final_folder);
    fs::rename(partial, final_folder);
  } catch (...) {
    fs::remove_all(partial, error);
    throw;
  }
  return clip_files(final_folder.string());
}

ClipFiles clip_files(const std::string& folder_name) {
  const fs::path folder = folder_name;
  ClipFiles files;
  files.name = folder.filename().string();
  files.camera = (folder / "camera.json").string();
  files.truth = (folder / "truth.jsonl").string();
  for (const char* name : {"frames", "clip.mp4", "clip.avi"})
    if (fs::exists(folder / name)) files.video = (folder / name).string();
  if (files.video.empty() || !fs::exists(files.camera) || !fs::exists(files.truth))
    throw InvalidInput(folder_name +
                       ": not a generated clip (frames or clip.*, camera.json, truth.jsonl)");
  return files;
}

}  // namespace semblance
