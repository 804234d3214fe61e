#include "semblance/lips/lip_tracker.h"

#include <algorithm>
#include <cmath>
#include <istream>
#include <ostream>

#include "assignment.h"
#include "median.h"
#include "semblance/core/errors.h"
#include "semblance/lips/mouth_layout.h"

namespace semblance {
namespace {

using Eigen::Vector2d;

constexpr int kFewestSeen = 3;
constexpr int kMostSpots = 250;          // that a search without a known look considers
constexpr double kLeastResponse = 0.2;   // of a candidate
constexpr double kWholeResponse = 0.5;   // of one that counts towards a full constellation
constexpr double kWorstResidual = 0.2;   // of a dot's fit, relative to its height
constexpr double kResidualFactor = 2.5;  // and relative to the usual one
constexpr double kLeastHeight = 0.75;    // of a whole dot, relative to its usual height
constexpr double kHeightShare = 0.2;     // of a new height in the usual one
constexpr double kHeightFade = 0.98;     // per frame in which the dot is not seen
constexpr double kClearlyCloser = 0.5;   // distance to the own place over that to another's
constexpr double kClearlyApart = 0.12;   // least distance to another's, in widths of the mouth
constexpr int kRelearnAfterFrames = 25;  // without the known look: any look is sought
constexpr double kFirstGate = 0.16, kGate = 0.08;  // of matching, in widths of the mouth
constexpr double kBetterNames = 0.8;  // misfit of other names over that of those followed
constexpr double kLikeAMouth = 0.04;  // misfit of right names, in widths of the mouth
constexpr double kNamingGate = 0.2;   // of matching to the whole arrangement
constexpr double kGateGrowth = 0.2, kWidestGate = 2.5;  // with every hidden frame, and at most
constexpr double kStepShare = 0.7;                      // of the last step that is expected again

int count_of(const std::vector<std::optional<DotFit>>& fits) {
  return static_cast<int>(
      std::count_if(fits.begin(), fits.end(), [](const auto& fit) { return fit.has_value(); }));
}

/// Index of the candidate of each predicted marker, -1 for none: least sum of squared distances in
/// units of the markers' gates, where going without costs as much as a full gate.
std::vector<int> match(const std::vector<Vector2d>& predicted_px,
                       const std::vector<double>& gates_px,
                       const std::vector<DotCandidate>& candidates) {
  const auto markers = static_cast<Eigen::Index>(predicted_px.size());
  const auto spots = static_cast<Eigen::Index>(candidates.size());
  Eigen::MatrixXd cost = Eigen::MatrixXd::Ones(markers, spots + markers);
  for (Eigen::Index i = 0; i < markers; ++i) {
    for (Eigen::Index j = 0; j < spots; ++j) {
      const double gap_px = (candidates[j].centre_px - predicted_px[i]).norm();
      cost(i, j) = std::min(std::pow(gap_px / gates_px[i], 2), 1e3);
    }
  }
  std::vector<int> matched = assign(cost);
  for (std::size_t i = 0; i < matched.size(); ++i) {
    if (matched[i] >= spots || cost(static_cast<Eigen::Index>(i), matched[i]) >= 1.0) {
      matched[i] = -1;
    }
  }
  return matched;
}

template <class T>
void put(std::ostream& out, const T& value) {
  out.write(reinterpret_cast<const char*>(&value), sizeof value);
}

template <class T>
void get(std::istream& in, T& value) {
  in.read(reinterpret_cast<char*>(&value), sizeof value);
}

/// Not every byte is a bool.
void get(std::istream& in, bool& value) {
  char byte = 0;
  get(in, byte);
  value = byte != 0;
}

}  // namespace

LipTracker::LipTracker(int marker_count)
    : count_(marker_count), followed_(static_cast<std::size_t>(marker_count)) {}

/// A dot that is partly hidden is flatter and has another shape: its place would be wrong.
std::optional<DotFit> LipTracker::measure(const Patch& patch, const Vector2d& start_px,
                                          double usual_height) const {
  auto fit = fit_dot(patch, *look_, start_px);
  const double worst_residual = std::max(kWorstResidual, kResidualFactor * usual_residual_);
  if (fit && (fit->residual_rms > worst_residual || fit->height < kLeastHeight * usual_height)) {
    fit.reset();
  }
  return fit;
}

/// A dot that could as well be another marker's, one that is not seen, is nobody's. One that comes
/// out of hiding has to be clearly closer to its own place: where that is, is known less well.
void LipTracker::drop_ambiguous(const std::vector<Vector2d>& predicted_px, Fits& fits) const {
  const Fits given = fits;
  for (std::size_t i = 0; i < given.size(); ++i) {
    if (!given[i]) continue;
    const Vector2d& place = given[i]->centre_px;
    const bool hidden = followed_[i].hidden_frames > 0;
    const double share = hidden ? kClearlyCloser : 1.0;
    const double least_px = hidden ? kClearlyApart * mouth_width_px() : 0.0;
    for (std::size_t j = 0; j < given.size(); ++j) {
      if (given[j]) continue;
      const double own = (predicted_px[i] - place).norm();
      const double other = (predicted_px[j] - place).norm();
      if (own > share * other || other < least_px) fits[i].reset();
    }
  }
}

LipTracker::Fits LipTracker::fit_constellation(const Patch& patch,
                                               const std::vector<Spot>& dots) const {
  Fits fits(followed_.size());
  for (std::size_t i = 0; i < dots.size(); ++i) fits[i] = measure(patch, dots[i].centre_px, 0.0);
  return fits;
}

LipTracker::Fits LipTracker::acquire(const Image& linear_rgb) {
  const PixelRect whole{0, 0, linear_rgb.width, linear_rgb.height};
  if (look_ && lost_frames_ < kRelearnAfterFrames) {
    const Patch patch = project_look(linear_rgb, *look_, whole);
    std::vector<Spot> spots;
    for (const DotCandidate& candidate : find_candidates(patch, *look_, kWholeResponse)) {
      if (static_cast<int>(spots.size()) == kMostSpots) break;
      const auto contrast = static_cast<float>(candidate.response);
      spots.push_back({candidate.centre_px, look_->radius_px, {contrast, 0.0f, 0.0f}});
    }
    return fit_constellation(patch, find_constellation(spots, count_));
  }
  const auto dots = find_constellation(find_spots(linear_rgb, kMostSpots), count_);
  if (dots.empty()) return Fits(followed_.size());
  try {
    look_ = learn_look(linear_rgb, dots);
  } catch (const SolverError&) {
    return Fits(followed_.size());  // the arrangement of something else
  }
  usual_residual_ = 0.4;  // until it is known
  const Patch patch = project_look(linear_rgb, *look_, whole);
  Fits fits = fit_constellation(patch, dots);
  if (count_of(fits) == count_) {
    std::vector<double> residuals;
    for (const auto& fit : fits) residuals.push_back(fit->residual_rms);
    usual_residual_ = median(residuals);
  } else {
    look_.reset();
  }
  return fits;
}

double LipTracker::mouth_width_px() const {
  double least = followed_.front().position_px.x(), greatest = least;
  for (const Followed& marker : followed_) {
    least = std::min(least, marker.position_px.x());
    greatest = std::max(greatest, marker.position_px.x());
  }
  return std::max(greatest - least, 8.0 * look_->radius_px);
}

/// Where a marker has gone is the less known the longer it is hidden.
std::vector<double> LipTracker::gates_px(double share_of_width) const {
  const double gate_px = share_of_width * mouth_width_px();
  std::vector<double> gates;
  for (const Followed& marker : followed_) {
    gates.push_back(gate_px * std::min(kWidestGate, 1.0 + kGateGrowth * marker.hidden_frames));
  }
  return gates;
}

/// Where the markers should be, by the motion that most candidates agree on, and which candidate is
/// which. Markers that were hidden have no say in the motion while others can tell it.
std::vector<Vector2d> LipTracker::predict(const std::vector<DotCandidate>& candidates,
                                          std::vector<int>& matched) const {
  std::vector<Vector2d> predicted;
  for (const Followed& marker : followed_) {
    predicted.push_back(marker.position_px + kStepShare * marker.step_px);
  }
  matched = match(predicted, gates_px(kFirstGate), candidates);
  for (int round = 0; round < 2; ++round) {
    std::vector<Vector2d> before, now;
    for (std::size_t i = 0; i < matched.size(); ++i) {
      if (matched[i] < 0 || followed_[i].hidden_frames > 0) continue;
      before.push_back(followed_[i].position_px);
      now.push_back(candidates[matched[i]].centre_px);
    }
    if (static_cast<int>(now.size()) < kFewestSeen) break;
    const PlaneMap motion = fit_map(before, now);
    std::vector<bool> known(predicted.size());
    for (std::size_t i = 0; i < predicted.size(); ++i) {
      known[i] = followed_[i].hidden_frames == 0;
      predicted[i] = motion(followed_[i].position_px);
    }
    predicted = with_hidden(std::move(predicted), known);
    matched = match(predicted, gates_px(kGate), candidates);
  }
  return predicted;
}

/// Places of all markers where some are known: the others stand to them as when all were last seen,
/// turned, scaled and moved. An affine map would carry what the seen part of the mouth does (open,
/// round) on into the hidden part, and step by step the errors would add up.
std::vector<Vector2d> LipTracker::with_hidden(std::vector<Vector2d> places_px,
                                              const std::vector<bool>& known) const {
  std::vector<Vector2d> before, now;
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (!known[i]) continue;
    before.push_back(followed_[i].whole_px);
    now.push_back(places_px[i]);
  }
  const PlaneMap map = fit_turn(before, now);
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (!known[i]) places_px[i] = map(followed_[i].whole_px);
  }
  return places_px;
}

/// What is followed from frame to frame while some are hidden can have a wrong name, and would keep
/// it. So the candidates are also matched to the whole arrangement as it was last seen; that counts
/// where it explains as many of them, and clearly better. Where neither does well, those that were
/// hidden since then are left out: no name is better than a wrong one.
void LipTracker::check_names(const std::vector<DotCandidate>& candidates,
                             std::vector<Vector2d>& predicted, std::vector<int>& matched) const {
  const auto pairs = [&](const std::vector<int>& list) {
    std::pair<std::vector<Vector2d>, std::vector<Vector2d>> out;
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (list[i] < 0) continue;
      out.first.push_back(followed_[i].whole_px);
      out.second.push_back(candidates[list[i]].centre_px);
    }
    return out;
  };
  const auto misfit = [&](const std::vector<int>& list) {
    const auto [before, now] = pairs(list);
    const PlaneMap map = fit_map(before, now);
    double squares = 0.0;
    for (std::size_t k = 0; k < now.size(); ++k) squares += (map(before[k]) - now[k]).squaredNorm();
    return std::sqrt(squares / static_cast<double>(now.size()));
  };
  const auto count = [](const std::vector<int>& list) {
    return std::count_if(list.begin(), list.end(), [](int i) { return i >= 0; });
  };
  if (count(matched) < kFewestSeen) return;
  std::vector<int> other = matched;
  std::vector<Vector2d> places(matched.size());
  const std::vector<double> gates(matched.size(), kNamingGate * mouth_width_px());
  for (int round = 0; round < 3; ++round) {
    const auto [before, now] = pairs(other);
    const PlaneMap map = round == 0 ? fit_turn(before, now) : fit_map(before, now);
    for (std::size_t i = 0; i < places.size(); ++i) places[i] = map(followed_[i].whole_px);
    other = match(places, gates, candidates);
  }
  if (count(other) >= count(matched) && misfit(other) < kBetterNames * misfit(matched)) {
    matched = other;
    predicted = places;
  }
  if (misfit(matched) < kLikeAMouth * mouth_width_px()) return;
  for (std::size_t i = 0; i < matched.size(); ++i) {
    if (!followed_[i].sure) matched[i] = -1;
  }
}

LipTracker::Fits LipTracker::fit_matched(const Patch& patch,
                                         const std::vector<DotCandidate>& candidates) const {
  std::vector<int> matched;
  std::vector<Vector2d> predicted = predict(candidates, matched);
  const bool some_hidden =
      std::any_of(followed_.begin(), followed_.end(),
                  [](const Followed& marker) { return marker.hidden_frames > 0; });
  if (some_hidden) check_names(candidates, predicted, matched);
  Fits fits(followed_.size());
  for (std::size_t i = 0; i < matched.size(); ++i) {
    if (matched[i] < 0) continue;
    fits[i] = measure(patch, candidates[matched[i]].centre_px, followed_[i].height);
  }
  drop_ambiguous(predicted, fits);
  std::vector<Vector2d> places(followed_.size(), Vector2d::Zero());
  std::vector<bool> known(followed_.size(), false);
  for (std::size_t i = 0; i < fits.size(); ++i) {
    known[i] = fits[i].has_value();
    if (known[i]) places[i] = fits[i]->centre_px;
  }
  while (count_of(fits) > 0 && !in_mouth_order(places, known)) {
    std::size_t worst = 0;
    double greatest = -1.0;
    for (std::size_t i = 0; i < fits.size(); ++i) {
      const double gap = known[i] ? (places[i] - predicted[i]).norm() : -1.0;
      if (gap > greatest) greatest = gap, worst = i;
    }
    fits[worst].reset();
    known[worst] = false;
  }
  return fits;
}

LipTracker::Fits LipTracker::advance(const Image& linear_rgb) {
  Vector2d low = followed_.front().position_px, high = low;
  for (const Followed& marker : followed_) {
    const Vector2d next = marker.position_px + kStepShare * marker.step_px;
    low = low.cwiseMin(next);
    high = high.cwiseMax(next);
  }
  const double margin_px = 0.3 * mouth_width_px() + 3.0 * look_->radius_px;
  const Vector2d corner = (low.array() - margin_px).max(-1e6).min(1e6),
                 size = (high - low).array() + 2.0 * margin_px;
  const Patch patch = project_look(linear_rgb, *look_,
                                   {static_cast<int>(corner.x()), static_cast<int>(corner.y()),
                                    static_cast<int>(size.x()), static_cast<int>(size.y())});
  const auto candidates = find_candidates(patch, *look_, kLeastResponse);
  const auto wanted = static_cast<std::size_t>(count_);
  // All are there, and nothing else that could be one: their arrangement tells which is which.
  const bool all = candidates.size() >= wanted &&
                   candidates[wanted - 1].response > kLeastResponse &&
                   (candidates.size() == wanted ||
                    candidates[wanted].response < 0.7 * candidates[wanted - 1].response);
  if (all) {
    std::vector<Vector2d> points;
    for (std::size_t i = 0; i < wanted; ++i) points.push_back(candidates[i].centre_px);
    if (const auto order = order_markers(points, look_->radius_px)) {
      Fits fits(followed_.size());
      for (std::size_t i = 0; i < wanted; ++i) {
        fits[i] = measure(patch, points[(*order)[i]], followed_[i].height);
      }
      return fits;
    }
  }
  return fit_matched(patch, candidates);
}

/// Seen markers are where they were measured; hidden ones go with the seen ones around them.
void LipTracker::remember(const Fits& fits, bool anew) {
  std::vector<Vector2d> places(fits.size(), Vector2d::Zero());
  std::vector<bool> known(fits.size());
  for (std::size_t i = 0; i < fits.size(); ++i) {
    known[i] = fits[i].has_value();
    if (known[i]) places[i] = fits[i]->centre_px;
  }
  const bool whole = count_of(fits) == count_;
  if (!whole) places = with_hidden(std::move(places), known);
  for (std::size_t i = 0; i < fits.size(); ++i) {
    Followed& marker = followed_[i];
    const Vector2d& place = places[i];
    if (whole) marker.whole_px = place;
    marker.sure = whole || (marker.sure && known[i]);
    marker.step_px = anew ? Vector2d(Vector2d::Zero()) : Vector2d(place - marker.position_px);
    marker.position_px = place;
    marker.hidden_frames = fits[i] ? 0 : marker.hidden_frames + 1;
    if (anew) marker.height = 0.0;
    if (!fits[i]) {
      marker.height *= kHeightFade;
    } else if (marker.height == 0.0) {
      marker.height = fits[i]->height;
    } else {
      marker.height += kHeightShare * (fits[i]->height - marker.height);
    }
  }
}

LipEstimate LipTracker::estimate(const Fits& fits) const {
  LipEstimate out;
  double contrast = 0.0, squares = 0.0;
  for (const auto& fit : fits) {
    TrackedMarker marker;
    if (fit) {
      marker.marker.state = MarkerState::seen;
      marker.marker.position_px = fit->centre_px;
      marker.sigma_px = fit->sigma_px;
      contrast += std::min(1.0, fit->height);
      squares += fit->residual_rms * fit->residual_rms;
    }
    out.markers.push_back(marker);
  }
  out.confidence = contrast / count_;
  out.residual_rms = std::sqrt(squares / std::max(1, count_of(fits)));
  return out;
}

LipEstimate LipTracker::follow(int frame, double time_s, const Image& linear_rgb) {
  const bool anew = !following_;
  const bool first = !look_;
  const Fits fits = following_ ? advance(linear_rgb) : acquire(linear_rgb);
  const int needed = anew ? count_ : kFewestSeen;
  following_ = count_of(fits) >= needed;
  LipEstimate out;
  if (following_) {
    remember(fits, anew);
    out = estimate(fits);
    out.status = anew && !first ? TrackStatus::reinitialised : TrackStatus::tracked;
    lost_frames_ = 0;
  } else {
    out.markers.resize(followed_.size());
    ++lost_frames_;
  }
  out.frame = frame;
  out.time_s = time_s;
  return out;
}

TrackFrame LipTracker::track(int frame, double time_s, const Observation& observation) {
  return to_track_frame(follow(frame, time_s, observation.linear));
}

void LipTracker::save_state(std::ostream& out) const {
  put(out, count_);
  put(out, look_.has_value());
  const DotLook look = look_.value_or(DotLook{});
  for (const float weight : look.weights) put(out, weight);
  put(out, look.radius_px);
  put(out, look.edge_px);
  put(out, usual_residual_);
  put(out, following_);
  put(out, lost_frames_);
  for (const Followed& marker : followed_) {
    for (const double value : marker.position_px) put(out, value);
    for (const double value : marker.whole_px) put(out, value);
    for (const double value : marker.step_px) put(out, value);
    put(out, marker.height);
    put(out, marker.hidden_frames);
    put(out, marker.sure);
  }
}

void LipTracker::restore_state(std::istream& in, const std::string& source) {
  int count = 0;
  bool has_look = false;
  DotLook look;
  get(in, count);
  get(in, has_look);
  for (float& weight : look.weights) get(in, weight);
  get(in, look.radius_px);
  get(in, look.edge_px);
  get(in, usual_residual_);
  get(in, following_);
  get(in, lost_frames_);
  for (Followed& marker : followed_) {
    for (double& value : marker.position_px) get(in, value);
    for (double& value : marker.whole_px) get(in, value);
    for (double& value : marker.step_px) get(in, value);
    get(in, marker.height);
    get(in, marker.hidden_frames);
    get(in, marker.sure);
  }
  if (!in || count != count_) {
    throw InvalidInput(source + ": was not saved by tracking " + std::to_string(count_) +
                       " lip markers; run without --resume to start afresh");
  }
  look_ = has_look ? std::optional(look) : std::nullopt;
}

}  // namespace semblance
