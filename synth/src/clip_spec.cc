#include "semblance/synth/clip_spec.h"

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/json_reader.h"

namespace semblance {
namespace {

using nlohmann::json;

// The one table of keys: `visit` hands every field with its range to a reader or a writer.
template <class Spec, class Visitor>
void visit_motion(Spec& s, Visitor& v) {
  v.number("yaw_deg", s.yaw_deg, 0, 80);
  v.number("pitch_deg", s.pitch_deg, 0, 60);
  v.number("roll_deg", s.roll_deg, 0, 60);
  v.number("distance_m", s.distance_m, 0.2, 10);
  v.number("distance_range_m", s.distance_range_m, 0, 5);
  v.number("sideways_m", s.sideways_m, 0, 5);
  v.number("height_m", s.height_m, -5, 5);
  v.number("peak_speed_deg_s", s.peak_speed_deg_s, 1, 1000);
  v.number("sway", s.sway, 0, 10);
  v.number("syllables_per_s", s.syllables_per_s, 0.5, 10);
  v.number("expression", s.expression, 0, 1.5);
}

template <class Spec, class Visitor>
void visit_occlusion(Spec& s, Visitor& v) {
  v.number("hand_from_s", s.hand_from_s, 0, 1e6);
  v.number("hand_to_s", s.hand_to_s, 0, 1e6);
  v.number("fingers_from_s", s.fingers_from_s, 0, 1e6);
  v.number("fingers_to_s", s.fingers_to_s, 0, 1e6);
  v.number("leave_from_s", s.leave_from_s, 0, 1e6);
  v.number("leave_to_s", s.leave_to_s, 0, 1e6);
}

template <class Spec, class Visitor>
void visit_look(Spec& s, Visitor& v) {
  v.number("identity_sigma", s.identity_sigma, 0, 3);
  v.number("identity_parameters", s.identity_parameters, 0, 10000);
  v.number("skin_tone", s.skin_tone, -1, 1);
  v.number("stubble", s.stubble, -1, 1);
  v.number("key_light", s.key_light, 0, 1);
  v.flag("clutter", s.clutter);
}

template <class Spec, class Visitor>
void visit_markers(Spec& s, Visitor& v) {
  v.number("count", s.count, 0, 16);
  v.number("diameter_m", s.diameter_m, 1e-4, 0.01);
  v.number("red", s.red, 0, 1);
  v.number("green", s.green, 0, 1);
  v.number("blue", s.blue, 0, 1);
}

template <class Spec, class Visitor>
void visit_sensor(Spec& s, Visitor& v) {
  v.number("samples", s.samples, 1, 16);
  v.number("lens_blur_px", s.lens_blur_px, 0, 20);
  v.number("sub_frames", s.sub_frames, 1, 64);
  v.number("exposure_s", s.exposure_s, 0, 1);
  v.number("noise_levels", s.noise_levels, 0, 64);
  v.number("tone_gamma", s.tone_gamma, 0.3, 3);
}

template <class Spec, class Visitor>
void visit_clip(Spec& s, Visitor& v) {
  v.text("name", s.name);
  v.text("model", s.model);
  v.number("density", s.density, 0.1, 10);
  v.number("seed", s.seed, 0, 9e15);
  v.number("frames", s.frames, 1, 1e6);
  v.number("frames_per_second", s.frames_per_second, 1, 1000);
  v.number("width", s.width, 16, 8192);
  v.number("height", s.height, 16, 8192);
  v.number("focal_px", s.focal_px, 8, 1e5);
  v.text("output", s.output);
  v.group("motion", [&](auto& inner) { visit_motion(s.motion, inner); });
  v.group("occlusion", [&](auto& inner) { visit_occlusion(s.occlusion, inner); });
  v.group("look", [&](auto& inner) { visit_look(s.look, inner); });
  v.group("markers", [&](auto& inner) { visit_markers(s.markers, inner); });
  v.group("sensor", [&](auto& inner) { visit_sensor(s.sensor, inner); });
}

class Writer {
 public:
  template <class T>
  void number(const char* key, const T& value, double, double) {
    out_[key] = value;
  }
  void text(const char* key, const std::string& value) { out_[key] = value; }
  void flag(const char* key, bool value) { out_[key] = value; }
  template <class Body>
  void group(const char* key, const Body& body) {
    Writer inner;
    body(inner);
    out_[key] = inner.out_;
  }
  const json& result() const { return out_; }

 private:
  json out_ = json::object();
};

void check_clip(const FaceClipSpec& spec, const std::string& where) {
  const bool plain = spec.name.find_first_not_of(
                         "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                         "0123456789-_") == std::string::npos;
  if (!plain)
    throw InvalidInput(where + ".name: expected letters, digits, '-' and '_' (it names a folder)");
  if (spec.output != "png" && spec.output != "mp4" && spec.output != "avi")
    throw InvalidInput(where + ".output: expected \"png\", \"mp4\" or \"avi\"");
  const int samples = spec.sensor.samples;
  if (samples != 1 && samples != 4 && samples != 16)
    throw InvalidInput(where + ".sensor.samples: expected 1, 4 or 16");
  const int markers = spec.markers.count;
  if (markers != 0 && markers != 8 && markers != 16)
    throw InvalidInput(where + ".markers.count: expected 0, 8 or 16");
  if (spec.motion.distance_range_m > 0.6 * spec.motion.distance_m)
    throw InvalidInput(where + ".motion.distance_range_m: expected at most 0.6 times distance_m");
}

}  // namespace

SynthSuite read_suite(const std::string& path_or_folder) {
  std::filesystem::path path = path_or_folder;
  if (std::filesystem::is_directory(path)) path /= "suite.json";
  const json in = read_json_file(path.string());
  JsonReader reader(in, path.string());
  SynthSuite suite;
  std::string schema;
  reader.text("schema", schema);
  if (schema != "semblance.suite/1") reader.fail("schema", "\"semblance.suite/1\"");
  reader.text("name", suite.name);
  if (suite.name.empty()) reader.fail("name", "a text");
  reader.text("about", suite.about);
  reader.flag("same_model", suite.same_model);
  FaceClipSpec defaults;
  reader.group("defaults", [&](JsonReader& inner) { visit_clip(defaults, inner); });
  const json* clips = reader.find("clips");
  if (clips == nullptr || !clips->is_array() || clips->empty() || clips->size() > 10000)
    reader.fail("clips", "a list of 1 to 10000 clips");
  reader.list("clips", [&](JsonReader& inner, std::size_t i) {
    FaceClipSpec spec = defaults;
    spec.name = "clip" + std::to_string(i + 1);
    visit_clip(spec, inner);
    suite.clips.push_back(std::move(spec));
  });
  reader.finish();
  std::set<std::string> names;
  for (std::size_t i = 0; i < suite.clips.size(); ++i) {
    const std::string where = path.string() + ": clips[" + std::to_string(i) + "]";
    check_clip(suite.clips[i], where);
    if (!names.insert(suite.clips[i].name).second)
      throw InvalidInput(where + ".name: '" + suite.clips[i].name +
                         "' is taken by an earlier clip");
  }
  return suite;
}

std::string clip_spec_json(const FaceClipSpec& spec) {
  Writer writer;
  visit_clip(spec, writer);
  return writer.result().dump(1);
}

std::string resolve_model(const FaceClipSpec& spec) {
  const std::string prefix = "data:";
  if (spec.model.rfind(prefix, 0) != 0) return spec.model;
  const char* folder = std::getenv("SEMBLANCE_DATA");
  if (folder == nullptr || *folder == '\0')
    throw InvalidInput("model '" + spec.model +
                       "': set the environment variable SEMBLANCE_DATA to the folder of assets");
  return (std::filesystem::path(folder) / spec.model.substr(prefix.size())).string();
}

}  // namespace semblance
