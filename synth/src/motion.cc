#include "semblance/synth/motion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "semblance/core/random.h"

namespace semblance {
namespace {

constexpr double kRadian = std::numbers::pi / 180;
using Pose = std::map<std::string, double>;  // mouth shapes by normalised ARKit name

// "eyeBlink_L", "eye_blink_left" and "eyeBlinkLeft" all become "eyeblinkl".
std::string normalised(const std::string& name) {
  std::string out;
  for (const char c : name)
    if (std::isalnum(static_cast<unsigned char>(c)))
      out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const auto& [word, letter] : {std::pair<std::string, char>{"left", 'l'}, {"right", 'r'}})
    if (out.size() > word.size() && out.ends_with(word))
      out.replace(out.size() - word.size(), word.size(), 1, letter);
  return out;
}

// Step from 0 to 1 with no velocity and acceleration at its ends (minimum jerk; Flash and Hogan
// 1985). Its peak velocity is 1.875 per unit of time.
double minimum_jerk(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * t * (10 + t * (6 * t - 15));
}

/// A value that rests at targets and moves between them with minimum jerk.
class Track {
 public:
  explicit Track(double start) : start_(start) {}
  void move(double from_s, double to_s, double target) { moves_.push_back({from_s, to_s, target}); }
  double at(double time_s) const {
    double value = start_;
    for (const Move& move : moves_) {
      if (time_s <= move.from_s) break;
      value +=
          (move.target - value) * minimum_jerk((time_s - move.from_s) / (move.to_s - move.from_s));
    }
    return value;
  }

 private:
  struct Move {
    double from_s, to_s, target;
  };
  double start_;
  std::vector<Move> moves_;
};

/// Smooth noise of deviation about 1: a few sines of random phase between two frequencies.
class Wander {
 public:
  Wander(Random& random, double lowest_hz, double highest_hz) {
    for (int i = 0; i < kWaves; ++i)
      waves_.push_back({random.uniform(lowest_hz, highest_hz) * 2 * std::numbers::pi,
                        random.uniform(0, 2 * std::numbers::pi)});
  }
  double at(double time_s) const {
    double sum = 0;
    for (const Wave& wave : waves_) sum += std::sin(wave.rate * time_s + wave.phase);
    return sum * std::sqrt(2.0 / kWaves);
  }

 private:
  static constexpr int kWaves = 5;
  struct Wave {
    double rate, phase;
  };
  std::vector<Wave> waves_;
};

struct Viseme {
  double time_s, reach_s;  // centre and width of its dominance
  double weight;
  Pose pose;
};

std::vector<Pose> consonants() {
  return {
      {{"jawopen", .04},
       {"mouthpressl", .35},
       {"mouthpressr", .35},
       {"mouthrolllower", .10},
       {"mouthrollupper", .08}},  // p b m
      {{"jawopen", .05},
       {"mouthrolllower", .30},
       {"mouthupperupl", .22},
       {"mouthupperupr", .22}},  // f v
      {{"jawopen", .08},
       {"mouthstretchl", .15},
       {"mouthstretchr", .15},
       {"mouthlowerdownl", .20},
       {"mouthlowerdownr", .20}},                                              // s t d
      {{"jawopen", .12}, {"mouthlowerdownl", .12}, {"mouthlowerdownr", .12}},  // k g n
      {{"jawopen", .07},
       {"mouthfunnel", .45},
       {"mouthupperupl", .15},
       {"mouthupperupr", .15}},                                                // sh
      {{"jawopen", .07}, {"mouthpucker", .45}},                                // w
      {{"jawopen", .16}, {"mouthlowerdownl", .15}, {"mouthlowerdownr", .15}},  // l
  };
}

std::vector<Pose> vowels() {
  return {
      {{"jawopen", .42},
       {"mouthlowerdownl", .22},
       {"mouthlowerdownr", .22},
       {"mouthupperupl", .10},
       {"mouthupperupr", .10}},  // a
      {{"jawopen", .25},
       {"mouthstretchl", .28},
       {"mouthstretchr", .28},
       {"mouthlowerdownl", .25},
       {"mouthlowerdownr", .25},
       {"mouthdimplel", .15},
       {"mouthdimpler", .15}},  // e
      {{"jawopen", .12},
       {"mouthsmilel", .30},
       {"mouthsmiler", .30},
       {"mouthstretchl", .25},
       {"mouthstretchr", .25},
       {"mouthlowerdownl", .20},
       {"mouthlowerdownr", .20}},                                      // i
      {{"jawopen", .30}, {"mouthfunnel", .50}},                        // o
      {{"jawopen", .12}, {"mouthpucker", .65}, {"mouthfunnel", .15}},  // u
  };
}

void add(Pose& to, const std::string& name, double value) { to[name] += value; }

void add_both(Pose& to, const std::string& name, double value) {
  add(to, name + "l", value);
  add(to, name + "r", value);
}

}  // namespace

struct FaceMotion::Impl {
  FaceClipSpec spec;
  ParameterSpace space;
  Eigen::VectorXd rest;
  std::map<std::string, int> columns;  // normalised name to entry of x
  std::vector<Viseme> visemes;
  std::vector<std::pair<double, double>> blinks;  // start, depth
  Track yaw{0}, pitch{0}, roll{0}, approach{0}, side{0}, rise{0}, away{0};
  Track brow{0}, frown{0}, smile{0}, smirk{0}, look_x{0}, look_y{0};
  std::vector<Wander> sway;

  void draw_identity(const MorphModel& model);
  void draw_speech(double length_s);
  void draw_blinks(double length_s);
  void draw_turns(double length_s);
  void draw_places(double length_s);
  void draw_moods(double length_s);
  void draw_gaze(double length_s);

  Pose expression(double time_s, const Eigen::Vector3d& head_deg) const;
  void speak(double time_s, Pose& pose) const;
  double blink(double time_s) const;
  Eigen::Vector3d head_angles(double time_s) const;
};

FaceMotion::FaceMotion(const FaceClipSpec& spec, const MorphModel& model)
    : impl_(std::make_unique<Impl>()) {
  Impl& m = *impl_;
  m.spec = spec;
  m.space = model.parameters();
  m.rest = m.space.initial();
  m.draw_identity(model);
  for (std::size_t i = MorphModel::first_shape_block + model.shape().identity_count;
       i < m.space.blocks().size(); ++i)
    m.columns[normalised(m.space.blocks()[i].name)] =
        static_cast<int>(m.space.offset(static_cast<int>(i)));
  const double length = spec.frames / spec.frames_per_second + 1.0;
  m.draw_speech(length);
  m.draw_blinks(length);
  m.draw_turns(length);
  m.draw_places(length);
  m.draw_moods(length);
  m.draw_gaze(length);
}

FaceMotion::~FaceMotion() = default;
FaceMotion::FaceMotion(FaceMotion&&) noexcept = default;

void FaceMotion::Impl::draw_identity(const MorphModel& model) {
  Random random(spec.seed, 1);
  const int count = std::min(spec.look.identity_parameters, model.shape().identity_count);
  for (int i = 0; i < count; ++i) {
    const int block_index = MorphModel::first_shape_block + i;
    const ParameterBlock& block = space.blocks()[block_index];
    const double sigma = std::isfinite(block.prior_sigma[0]) ? block.prior_sigma[0] : 1.0;
    const double drawn =
        rest[space.offset(block_index)] + spec.look.identity_sigma * sigma * random.normal();
    rest[space.offset(block_index)] = std::clamp(drawn, block.lower[0], block.upper[0]);
  }
}

void FaceMotion::Impl::draw_speech(double length_s) {
  Random random(spec.seed, 2);
  const auto closings = consonants(), openings = vowels();
  double time = random.uniform(0.1, 0.5);
  while (time < length_s) {
    const int syllables = 4 + random.integer(9);
    for (int i = 0; i < syllables; ++i) {
      const double duration = random.uniform(0.8, 1.25) / spec.motion.syllables_per_s;
      const double stress = random.uniform(0.65, 1.15);
      visemes.push_back({time, 0.16 * duration + 0.02, 1.0,
                         closings[random.integer(static_cast<int>(closings.size()))]});
      Pose open = openings[random.integer(static_cast<int>(openings.size()))];
      for (auto& [name, value] : open) value *= stress;
      visemes.push_back({time + 0.5 * duration, 0.24 * duration + 0.02, 1.2, open});
      time += duration;
    }
    time += random.uniform(0.25, 0.7);
  }
}

void FaceMotion::Impl::draw_blinks(double length_s) {
  Random random(spec.seed, 3);
  for (double time = random.uniform(0.6, 2.5); time < length_s; time += random.uniform(1.6, 5.0))
    blinks.emplace_back(time, random.uniform(0.85, 1.0));
}

// Turns visit both sides; every move takes as long as the peak speed asks for, then rests.
void FaceMotion::Impl::draw_turns(double length_s) {
  Random random(spec.seed, 4);
  const MotionSpec& motion = spec.motion;
  double time = random.uniform(0.3, 0.6);
  double sign = random.uniform() < 0.5 ? -1 : 1;
  Eigen::Vector3d now(random.uniform(-0.1, 0.1), random.uniform(-0.15, 0.15),
                      random.uniform(-0.2, 0.2));
  const Eigen::Vector3d limit(motion.yaw_deg, motion.pitch_deg, motion.roll_deg);
  yaw = Track(now.x() * limit.x());
  pitch = Track(now.y() * limit.y());
  roll = Track(now.z() * limit.z());
  for (int turn = 0; time < length_s; ++turn) {
    Eigen::Vector3d next(sign * random.uniform(0.9, 0.99), random.uniform(-0.95, 0.95),
                         random.uniform(-0.95, 0.95));
    if (turn % 3 == 2)
      next.x() = random.uniform(-0.5, 0.5);  // between two turns, look about
    else
      sign = -sign;
    const double angle = (next - now).cwiseProduct(limit).cwiseAbs().maxCoeff();
    const double duration =
        std::max(0.35, 1.875 * angle / (motion.peak_speed_deg_s * random.uniform(0.8, 1.0)));
    yaw.move(time, time + duration, next.x() * limit.x());
    const double lag = random.uniform(0.0, 0.2) * duration;
    pitch.move(time + lag, time + lag + duration, next.y() * limit.y());
    roll.move(time + lag, time + lag + duration, next.z() * limit.z());
    now = next;
    time += duration + lag + random.uniform(0.35, 0.75);
  }
  Random small(spec.seed, 5);
  for (int i = 0; i < 3; ++i) sway.emplace_back(small, 1.0, 2.5);   // nods of speech
  for (int i = 0; i < 6; ++i) sway.emplace_back(small, 0.15, 0.6);  // posture
}

void FaceMotion::Impl::draw_places(double length_s) {
  Random random(spec.seed, 6);
  const MotionSpec& motion = spec.motion;
  approach = Track(random.uniform(-0.3, 0.3) * motion.distance_range_m);
  side = Track(random.uniform(-0.4, 0.4) * motion.sideways_m);
  rise = Track(random.uniform(-0.4, 0.4) * motion.sideways_m);
  for (double time = random.uniform(0.2, 0.8); time < length_s;) {
    const double duration = random.uniform(0.9, 1.8);
    approach.move(time, time + duration, random.uniform(-1, 1) * motion.distance_range_m);
    side.move(time, time + duration, random.uniform(-1, 1) * motion.sideways_m);
    rise.move(time, time + duration, random.uniform(-0.7, 0.5) * motion.sideways_m);
    time += duration + random.uniform(0.3, 0.9);
  }
  const OcclusionSpec& gone = spec.occlusion;
  if (gone.leave_to_s > gone.leave_from_s) {
    const double way = random.uniform() < 0.5 ? -1 : 1;
    away.move(gone.leave_from_s - 0.5, gone.leave_from_s, way);
    away.move(gone.leave_to_s, gone.leave_to_s + 0.5, 0);
  }
}

void FaceMotion::Impl::draw_moods(double length_s) {
  Random random(spec.seed, 7);
  const auto episodes = [&](Track& track, double pause_from, double pause_to, double strongest) {
    for (double time = random.uniform(0.3, pause_to); time < length_s;) {
      const double hold = random.uniform(0.2, 1.2);
      track.move(time, time + 0.3, random.uniform(0.3, 1.0) * strongest);
      track.move(time + 0.3 + hold, time + 0.7 + hold, 0);
      time += 0.7 + hold + random.uniform(pause_from, pause_to);
    }
  };
  episodes(brow, 0.6, 2.0, 0.8);
  episodes(frown, 1.0, 3.0, 0.6);
  episodes(smile, 1.0, 3.0, 0.55);
  episodes(smirk, 1.5, 4.0, 0.25);
}

void FaceMotion::Impl::draw_gaze(double length_s) {
  Random random(spec.seed, 8);
  for (double time = random.uniform(0.3, 1.0); time < length_s; time += random.uniform(0.4, 2.0)) {
    const bool back = random.uniform() < 0.5;  // half of the saccades return to the camera
    look_x.move(time, time + 0.05, back ? 0.0 : random.uniform(-12, 12));
    look_y.move(time, time + 0.05, back ? 0.0 : random.uniform(-8, 6));
  }
}

void FaceMotion::Impl::speak(double time_s, Pose& pose) const {
  double total = 0.12;  // the mouth at rest always has some dominance
  Pose sum;
  for (const Viseme& viseme : visemes) {
    const double gap = (time_s - viseme.time_s) / viseme.reach_s;
    if (std::abs(gap) > 4) continue;
    const double dominance = viseme.weight * std::exp(-0.5 * gap * gap);
    total += dominance;
    for (const auto& [name, value] : viseme.pose) sum[name] += dominance * value;
  }
  for (const auto& [name, value] : sum) pose[name] += value / total;
}

double FaceMotion::Impl::blink(double time_s) const {
  constexpr double kClosing = 0.09, kClosed = 0.03, kOpening = 0.17;
  double value = 0;
  for (const auto& [start, depth] : blinks) {
    const double t = time_s - start;
    if (t <= 0 || t >= kClosing + kClosed + kOpening) continue;
    const double down = minimum_jerk(t / kClosing);
    const double up = minimum_jerk((t - kClosing - kClosed) / kOpening);
    value = std::max(value, depth * (down - up));
  }
  return value;
}

Eigen::Vector3d FaceMotion::Impl::head_angles(double time_s) const {
  const double nod = 0.35 * spec.motion.sway * spec.motion.expression,
               drift = 0.3 * spec.motion.sway;
  return {yaw.at(time_s) + nod * 0.5 * sway[0].at(time_s) + drift * sway[3].at(time_s),
          pitch.at(time_s) + nod * sway[1].at(time_s) + drift * sway[4].at(time_s),
          roll.at(time_s) + nod * 0.5 * sway[2].at(time_s) + drift * sway[5].at(time_s)};
}

Pose FaceMotion::Impl::expression(double time_s, const Eigen::Vector3d& head_deg) const {
  Pose pose;
  speak(time_s, pose);
  const double smiling = smile.at(time_s);
  add_both(pose, "mouthsmile", smiling);
  add_both(pose, "cheeksquint", 0.7 * smiling);
  add_both(pose, "cheekraiser", 0.4 * smiling);
  add(pose, "mouthsmilel", smirk.at(time_s));
  add(pose, "browinnerup", brow.at(time_s));
  add_both(pose, "browinnerup", brow.at(time_s));
  add_both(pose, "browouterup", 0.7 * brow.at(time_s));
  add_both(pose, "browdown", frown.at(time_s));
  for (auto& [name, value] : pose) value *= spec.motion.expression;
  // The eyes keep looking near the camera: they turn back against the head, up to 25 degrees.
  const double x_deg = std::clamp(look_x.at(time_s) - 0.9 * head_deg.x(), -25.0, 25.0);
  const double y_deg = std::clamp(look_y.at(time_s) + 0.8 * head_deg.y(), -18.0, 18.0);
  constexpr double kFullDeg = 30.0;  // a look parameter of 1 turns the eye by about this
  add(pose, x_deg > 0 ? "eyelookoutl" : "eyelookinl", std::abs(x_deg) / kFullDeg);
  add(pose, x_deg > 0 ? "eyelookinr" : "eyelookoutr", std::abs(x_deg) / kFullDeg);
  add_both(pose, y_deg > 0 ? "eyelookup" : "eyelookdown", std::abs(y_deg) / kFullDeg);
  // Models may instead turn both eyes with one signed parameter per axis (35 and 25 degrees).
  add(pose, "eyelookhorizontal", x_deg / 35.0);
  add(pose, "eyelookvertical", y_deg / 25.0);
  const double shut = spec.motion.expression > 0 ? blink(time_s) : 0.0;
  add_both(pose, "eyeblink", shut);
  // Lids that follow a lowered gaze and a blink would otherwise close twice.
  if (y_deg <= 0)
    for (const char* lid : {"eyelookdownl", "eyelookdownr"}) pose[lid] *= 1 - 0.8 * shut;
  return pose;
}

Eigen::VectorXd FaceMotion::at(double time_s) const {
  const Impl& m = *impl_;
  const Eigen::Vector3d head_deg = m.head_angles(time_s);
  // x > 0 turns the nose to the head's left (+x), y > 0 lowers it, z > 0 tilts counter-clockwise.
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(Eigen::AngleAxisd(head_deg.x() * kRadian, Eigen::Vector3d::UnitY())) *
      Eigen::Quaterniond(Eigen::AngleAxisd(head_deg.y() * kRadian, Eigen::Vector3d::UnitX())) *
      Eigen::Quaterniond(Eigen::AngleAxisd(head_deg.z() * kRadian, Eigen::Vector3d::UnitZ()));
  // The head turns about the top of the neck, below and behind the eyes.
  const Eigen::Vector3d pivot(0.0, -0.08, -0.09);
  const double sway = 0.0015 * m.spec.motion.sway;
  const double distance =
      m.spec.motion.distance_m + m.approach.at(time_s) + sway * m.sway[6].at(time_s);
  const double half_view = distance * 0.5 * m.spec.width / m.spec.focal_px + 0.16;
  const Eigen::Vector3d place(
      m.side.at(time_s) + m.away.at(time_s) * half_view + sway * m.sway[7].at(time_s),
      m.spec.motion.height_m + m.rise.at(time_s) + sway * m.sway[8].at(time_s), -distance);
  Eigen::VectorXd x = m.rest;
  x.head<4>() << turn.w(), turn.x(), turn.y(), turn.z();
  x.segment<3>(4) = place + pivot - turn * pivot;
  for (const auto& [name, value] : m.expression(time_s, head_deg)) {
    const auto column = m.columns.find(name);
    if (column != m.columns.end()) x[column->second] = value;
  }
  for (int i = MorphModel::first_shape_block; i < static_cast<int>(m.space.blocks().size()); ++i) {
    const ParameterBlock& block = m.space.blocks()[i];
    double& value = x[m.space.offset(i)];
    value = std::clamp(value, block.lower[0], block.upper[0]);
  }
  return x;
}

int FaceMotion::driven_count() const {
  int count = 0;
  const Pose pose = impl_->expression(0.5, Eigen::Vector3d::Ones());
  for (const auto& [name, value] : pose) count += impl_->columns.count(name) != 0 ? 1 : 0;
  return count;
}

}  // namespace semblance
