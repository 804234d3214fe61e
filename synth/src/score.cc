#include "semblance/synth/score.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>

#include "quantile.h"
#include "semblance/core/errors.h"
#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegree = 180 / std::numbers::pi;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kWrongPoseDeg = 10.0, kWrongLandmarksPercent = 15.0;
constexpr double kStillDegS = 6.0, kStillMS = 0.030;
constexpr int kLandmarks = 68;

/// One frame of the truth with what the track says about it.
struct Pair {
  int frame = 0;
  double time_s = 0;
  bool present = true;  // the head is in the picture
  bool tracked = false;
  Quaterniond true_turn, turn;
  Vector3d true_place_m, place_m;
  std::vector<Vector2d> gaps_px;  // track minus truth; empty where not tracked
  std::vector<bool> seen;
  double eye_distance_px = 1;
  Eigen::Matrix<double, 2, 3> px_from_model;  // how far a shift in the head's frame moves a point
  Eigen::VectorXd x, true_x, sigma;
};

struct Clip {
  std::string name;
  std::vector<Pair> pairs;
  bool same_parameters = false;
};

Quaterniond quaternion(const Eigen::Vector4d& wxyz) {
  return Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).normalized();
}

double angle_deg(const Quaterniond& a, const Quaterniond& b) {
  return kDegree * rotation_vector_from_quaternion(a.conjugate() * b).norm();
}

// ---- reading -----------------------------------------------------------------------------------

// The camera's part in moving pixels: focal lengths and rotation, from the truth's header.
struct View {
  Vector2d focal_px;
  Rigid3 camera_from_world;
};

Pair pair_of(const ScoredClip& clip, const View& view, const TrackFrame& truth,
             const TrackFrame* found) {
  const auto fail = [&](const std::string& what) {
    throw InvalidInput("clip " + clip.name + ", frame " + std::to_string(truth.frame) + ": " +
                       what);
  };
  if (truth.status == TrackStatus::lost || truth.landmarks_px.size() != kLandmarks)
    fail("the truth must have a pose and 68 landmarks");
  Pair pair;
  pair.frame = truth.frame;
  pair.time_s = truth.time_s;
  pair.present = !truth.extra.is_object() || truth.extra.value("in_picture", true);
  pair.true_turn = quaternion(truth.rotation_wxyz);
  pair.true_place_m = truth.translation_m;
  pair.true_x = truth.x;
  pair.eye_distance_px = (truth.landmarks_px[45] - truth.landmarks_px[36]).norm();
  if (!(pair.eye_distance_px > 0)) fail("the eye corners of the truth coincide");
  pair.seen.assign(kLandmarks, true);
  if (truth.extra.is_object() && truth.extra.contains("landmarks_visible")) {
    const auto& list = truth.extra["landmarks_visible"];
    if (!list.is_array() || list.size() != kLandmarks)
      fail("landmarks_visible must have 68 entries");
    for (int i = 0; i < kLandmarks; ++i)
      pair.seen[i] = list[i].is_number() && list[i].get<double>() != 0;
  }
  const double depth = (view.camera_from_world * pair.true_place_m).z();
  pair.px_from_model =
      (view.focal_px / depth).asDiagonal() *
      (view.camera_from_world.rotation * pair.true_turn).toRotationMatrix().topRows<2>();
  if (found == nullptr || found->status == TrackStatus::lost) return pair;
  pair.tracked = true;
  pair.turn = quaternion(found->rotation_wxyz);
  pair.place_m = found->translation_m;
  pair.x = found->x;
  pair.sigma = found->sigma;
  if (found->landmarks_px.size() != kLandmarks) fail("the track must have 68 landmarks");
  for (int i = 0; i < kLandmarks; ++i)
    pair.gaps_px.push_back(found->landmarks_px[i] - truth.landmarks_px[i]);
  return pair;
}

View view_of(const ScoredClip& clip) {
  View view{Vector2d::Ones(), {}};
  try {
    const auto& camera = clip.truth.header.at("cameras").at(0);
    const auto& focal = camera.at("focal_px");
    view.focal_px = {focal.at(0).get<double>(), focal.at(1).get<double>()};
    const auto& pose = camera.at("camera_from_world");
    const auto turn = pose.at("rotation_wxyz").get<std::array<double, 4>>();
    const auto place = pose.at("translation_m").get<std::array<double, 3>>();
    view.camera_from_world = {Quaterniond(turn[0], turn[1], turn[2], turn[3]).normalized(),
                              Vector3d(place[0], place[1], place[2])};
  } catch (const nlohmann::json::exception& problem) {
    throw InvalidInput("clip " + clip.name +
                       ": the truth's header has no camera: " + problem.what());
  }
  return view;
}

Clip pairs_of(const ScoredClip& clip) {
  if (clip.truth.frames.empty())
    throw InvalidInput("clip " + clip.name + ": the truth has no frames");
  std::map<int, const TrackFrame*> by_number;
  for (const TrackFrame& frame : clip.track.frames) by_number[frame.frame] = &frame;
  const View view = view_of(clip);
  Clip out{clip.name, {}, false};
  for (const TrackFrame& truth : clip.truth.frames) {
    const auto found = by_number.find(truth.frame);
    out.pairs.push_back(
        pair_of(clip, view, truth, found == by_number.end() ? nullptr : found->second));
  }
  const auto names = [](const Track& track) {
    std::vector<std::string> list;
    if (track.header.contains("parameters"))
      for (const auto& entry : track.header["parameters"]) list.push_back(entry.value("name", ""));
    return list;
  };
  out.same_parameters = names(clip.track) == names(clip.truth);
  return out;
}

// ---- the constants between two models ----------------------------------------------------------

std::vector<const Pair*> usable(const std::vector<const Clip*>& clips) {
  std::vector<const Pair*> out;
  for (const Clip* clip : clips)
    for (const Pair& pair : clip->pairs)
      if (pair.tracked && pair.present) out.push_back(&pair);
  return out;
}

// The rotation with the least sum of angles to true^-1 * found, by Weiszfeld steps (Hartley, Aftab
// and Trumpf 2011, "L1 rotation averaging using the Weiszfeld algorithm"): wrong frames do not
// pull.
Quaterniond rotation_offset(const std::vector<const Pair*>& pairs) {
  Quaterniond mean = Quaterniond::Identity();
  for (int step = 0; step < 50; ++step) {
    Vector3d sum = Vector3d::Zero();
    double weights = 0;
    for (const Pair* pair : pairs) {
      const Vector3d gap = rotation_vector_from_quaternion(
          mean.conjugate() * (pair->true_turn.conjugate() * pair->turn));
      const double weight = 1 / std::max(gap.norm(), 1e-9);
      sum += weight * gap;
      weights += weight;
    }
    if (weights <= 0) break;
    const Vector3d move = sum / weights;
    mean = (mean * quaternion_from_rotation_vector(move)).normalized();
    if (move.norm() < 1e-12) break;
  }
  return mean;
}

Vector3d origin_offset(const std::vector<const Pair*>& pairs) {
  Vector3d offset = Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Pair* pair : pairs)
      values.push_back((pair->true_turn.conjugate() * (pair->place_m - pair->true_place_m))[axis]);
    if (!values.empty()) offset[axis] = quantile(values, 0.5);
  }
  return offset;
}

// scale and offset with place = scale * true_place + true_turn * offset, by reweighted least
// squares (the sum of distances). A weak pull of the offset to zero settles a head that never
// turns.
std::pair<double, Vector3d> scale_and_offset(const std::vector<const Pair*>& pairs) {
  constexpr double kPull = 1e-3;
  Eigen::Vector4d solution(1, 0, 0, 0);
  for (int step = 0; step < 20 && !pairs.empty(); ++step) {
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    double weights = 0;
    for (const Pair* pair : pairs) {
      Eigen::Matrix<double, 3, 4> row;
      row << pair->true_place_m, pair->true_turn.toRotationMatrix();
      const double weight =
          step == 0 ? 1.0 : 1 / std::max((row * solution - pair->place_m).norm(), 1e-6);
      normal += weight * row.transpose() * row;
      right += weight * row.transpose() * pair->place_m;
      weights += weight;
    }
    normal.diagonal().tail<3>().array() += kPull * weights;
    solution = normal.ldlt().solve(right);
  }
  return {solution[0], solution.tail<3>()};
}

// Per landmark the place in the head's frame (metres) whose image explains its errors best.
std::vector<Vector3d> landmark_offsets(const std::vector<const Pair*>& pairs) {
  std::vector<Vector3d> offsets(kLandmarks, Vector3d::Zero());
  for (int k = 0; k < kLandmarks; ++k) {
    Vector3d& offset = offsets[k];
    for (int step = 0; step < 10 && !pairs.empty(); ++step) {
      Matrix3d normal = Matrix3d::Zero();
      Vector3d right = Vector3d::Zero();
      for (const Pair* pair : pairs) {
        const double left = (pair->gaps_px[k] - pair->px_from_model * offset).norm();
        const double weight = step == 0 ? 1.0 : 1 / std::max(left, 1e-3);
        normal += weight * pair->px_from_model.transpose() * pair->px_from_model;
        right += weight * pair->px_from_model.transpose() * pair->gaps_px[k];
      }
      normal.diagonal().array() += 1e-4 * normal.trace();
      offset = normal.ldlt().solve(right);
    }
  }
  return offsets;
}

struct Constants {
  Quaterniond turn = Quaterniond::Identity();
  Vector3d origin_m = Vector3d::Zero();
  std::vector<Vector3d> landmarks_m = std::vector<Vector3d>(kLandmarks, Vector3d::Zero());
};

// ---- figures -----------------------------------------------------------------------------------

using Choice = std::vector<int>;

Choice numbers_from_to(int first, int last) {
  Choice out;
  for (int i = first; i <= last; ++i) out.push_back(i);
  return out;
}

double landmark_percent(const Pair& pair, const std::vector<Vector3d>& offsets_m,
                        const Choice& choice, bool only_seen) {
  double sum = 0;
  int count = 0;
  for (const int k : choice) {
    if (only_seen && !pair.seen[k]) continue;
    sum += (pair.gaps_px[k] - pair.px_from_model * offsets_m[k]).norm();
    ++count;
  }
  return count == 0 ? kNan : 100 * sum / count / pair.eye_distance_px;
}

/// Errors of frames, gathered over one clip or all.
struct Gathered {
  ClipScore counts;
  std::vector<double> turn[3], place[3];       // absolute, aligned, per clip
  std::vector<double> marks[2][4];             // absolute, aligned; all, visible, inner, corners
  double turn_jitter2 = 0, place_jitter2 = 0;  // sums of squares
  int within[3][2] = {}, sigma_count[3] = {};  // rotation, translation, others

  void add(const Clip& clip, const Constants& suite);
  void add_jitter(const Clip& clip, const Constants& suite);
  void add_coverage(const Clip& clip, const Pair& pair, const Constants& suite);
  void count_sigma(int kind, double error, double sigma);
  ClipScore result(const std::string& name) const;
};

void Gathered::count_sigma(int kind, double error, double sigma) {
  if (!(sigma > 0) || !std::isfinite(sigma)) return;
  ++sigma_count[kind];
  for (int level = 0; level < 2; ++level)
    within[kind][level] += std::abs(error) <= (level + 1) * sigma ? 1 : 0;
}

// Entries of x: four of the rotation, three of the translation, then the model's own.
void Gathered::add_coverage(const Clip& clip, const Pair& pair, const Constants& suite) {
  if (pair.sigma.size() != pair.x.size() || pair.x.size() < 7) return;
  Quaterniond expected = pair.true_turn * suite.turn;
  if (expected.dot(pair.turn) < 0) expected.coeffs() = -expected.coeffs();
  const Eigen::Vector4d gap(pair.turn.w() - expected.w(), pair.turn.x() - expected.x(),
                            pair.turn.y() - expected.y(), pair.turn.z() - expected.z());
  for (int i = 0; i < 4; ++i) count_sigma(0, gap[i], pair.sigma[i]);
  const Vector3d shift = pair.place_m - pair.true_place_m - pair.true_turn * suite.origin_m;
  for (int i = 0; i < 3; ++i) count_sigma(1, shift[i], pair.sigma[4 + i]);
  if (!clip.same_parameters || pair.x.size() != pair.true_x.size()) return;
  for (Eigen::Index i = 7; i < pair.x.size(); ++i)
    count_sigma(2, pair.x[i] - pair.true_x[i], pair.sigma[i]);
}

void Gathered::add_jitter(const Clip& clip, const Constants& suite) {
  for (std::size_t i = 1; i < clip.pairs.size(); ++i) {
    const Pair &a = clip.pairs[i - 1], &b = clip.pairs[i];
    if (!a.tracked || !b.tracked || !a.present || !b.present || b.frame != a.frame + 1) continue;
    const double step_s = b.time_s - a.time_s;
    if (!(step_s > 0) || angle_deg(a.true_turn, b.true_turn) > kStillDegS * step_s ||
        (a.true_place_m - b.true_place_m).norm() > kStillMS * step_s)
      continue;
    const auto turn_gap = [&](const Pair& p) {
      return rotation_vector_from_quaternion((p.true_turn * suite.turn).conjugate() * p.turn);
    };
    const auto place_gap = [&](const Pair& p) -> Vector3d {
      return p.place_m - p.true_place_m - p.true_turn * suite.origin_m;
    };
    turn_jitter2 += 0.5 * (turn_gap(b) - turn_gap(a)).squaredNorm();
    place_jitter2 += 0.5 * (place_gap(b) - place_gap(a)).squaredNorm();
    ++counts.still_pairs;
  }
}

void Gathered::add(const Clip& clip, const Constants& suite) {
  static const Choice groups[4] = {numbers_from_to(0, 67),
                                   numbers_from_to(0, 67),
                                   numbers_from_to(17, 67),
                                   {36, 39, 42, 45, 48, 54}};
  const std::vector<Vector3d> no_offsets(kLandmarks, Vector3d::Zero());
  const auto own = usable({&clip});
  const Quaterniond own_turn = rotation_offset(own);
  const auto [own_scale, own_origin] = scale_and_offset(own);
  for (const Pair& pair : clip.pairs) {
    counts.frames += pair.present ? 1 : 0;
    counts.absent += pair.present ? 0 : 1;
    counts.lost += pair.present && !pair.tracked ? 1 : 0;
    if (!pair.tracked) continue;
    const double aligned = angle_deg(pair.true_turn * suite.turn, pair.turn);
    const double all = landmark_percent(pair, no_offsets, groups[0], false);
    if (!(aligned <= kWrongPoseDeg && all <= kWrongLandmarksPercent)) ++counts.unflagged;
    if (!pair.present) continue;
    ++counts.tracked;
    turn[0].push_back(angle_deg(pair.true_turn, pair.turn));
    turn[1].push_back(aligned);
    turn[2].push_back(angle_deg(pair.true_turn * own_turn, pair.turn));
    const Vector3d gap = pair.place_m - pair.true_place_m;
    const double percent = 100 / pair.true_place_m.norm();
    place[0].push_back(percent * gap.norm());
    place[1].push_back(percent * (gap - pair.true_turn * suite.origin_m).norm());
    place[2].push_back(
        percent *
        (pair.place_m - own_scale * pair.true_place_m - pair.true_turn * own_origin).norm() /
        own_scale);
    for (int g = 0; g < 4; ++g)
      for (int kind = 0; kind < 2; ++kind) {
        const double value =
            landmark_percent(pair, kind == 0 ? no_offsets : suite.landmarks_m, groups[g], g == 1);
        if (std::isfinite(value)) marks[kind][g].push_back(value);
      }
    add_coverage(clip, pair, suite);
  }
  add_jitter(clip, suite);
}

ClipScore Gathered::result(const std::string& name) const {
  ClipScore out = counts;
  out.name = name;
  out.rotation_absolute_deg = spread(turn[0]);
  out.rotation_aligned_deg = spread(turn[1]);
  out.rotation_per_clip_deg = spread(turn[2]);
  out.translation_absolute_percent = spread(place[0]);
  out.translation_aligned_percent = spread(place[1]);
  out.translation_per_clip_percent = spread(place[2]);
  const auto group = [&](int kind) {
    return LandmarkScore{spread(marks[kind][0]), spread(marks[kind][1]), spread(marks[kind][2]),
                         spread(marks[kind][3])};
  };
  out.landmarks_absolute_percent = group(0);
  out.landmarks_aligned_percent = group(1);
  const double pairs = counts.still_pairs;
  out.rotation_jitter_deg = pairs > 0 ? kDegree * std::sqrt(turn_jitter2 / pairs) : kNan;
  out.translation_jitter_mm = pairs > 0 ? 1000 * std::sqrt(place_jitter2 / pairs) : kNan;
  const auto coverage = [&](int kind) {
    const double count = sigma_count[kind];
    if (sigma_count[kind] == 0) return Coverage{kNan, kNan, 0};
    return Coverage{within[kind][0] / count, within[kind][1] / count, sigma_count[kind]};
  };
  out.rotation_coverage = coverage(0);
  out.translation_coverage = coverage(1);
  out.parameter_coverage = coverage(2);
  return out;
}

}  // namespace

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return kNan;
  std::sort(values.begin(), values.end());
  const double place = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (place - static_cast<double>(below)) * (values[above] - values[below]);
}

Spread spread(const std::vector<double>& values) {
  return {quantile(values, 0.5), quantile(values, 0.95)};
}

SuiteScore score_tracks(const std::vector<ScoredClip>& given) {
  std::vector<Clip> clips;
  for (const ScoredClip& clip : given) clips.push_back(pairs_of(clip));
  std::vector<const Clip*> all;
  for (const Clip& clip : clips) all.push_back(&clip);
  const auto pairs = usable(all);
  const Constants suite{rotation_offset(pairs), origin_offset(pairs), landmark_offsets(pairs)};
  SuiteScore score;
  score.rotation_offset = suite.turn;
  score.origin_offset_m = suite.origin_m;
  Gathered total;
  for (const Clip& clip : clips) {
    Gathered one;
    one.add(clip, suite);
    score.clips.push_back(one.result(clip.name));
    total.add(clip, suite);
  }
  score.overall = total.result("all clips");
  return score;
}

ScoredClip read_scored_clip(const std::string& name, const std::string& track_path,
                            const std::string& truth_path) {
  return {name, read_track(track_path), read_track(truth_path)};
}

}  // namespace semblance
