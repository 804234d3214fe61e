#include "semblance/cameras/dot_tracks.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace semblance {
namespace {

using Eigen::Vector2d;

constexpr double kReach = 0.4;       // of the distance to the nearest other dot
constexpr double kFirstReach = 0.5;  // the same while the common motion is not known
constexpr double kClearer = 2.0;     // the second nearest is this much further
constexpr double kLikeRadius = 1.6;
constexpr int kMostMissed = 5;  // pictures that a track bridges
constexpr int kNeighbours = 5;  // whose motion a dot shares
constexpr double kInfinite = std::numeric_limits<double>::infinity();

struct Track {
  int id = 0;
  Dot dot;                            // as last seen
  Vector2d place = Vector2d::Zero();  // now, seen or expected
  Vector2d speed = Vector2d::Zero();  // px a picture
  int missed = 0;
};

bool alike(const Dot& a, const Dot& b) {
  const double ratio = a.radius_px() / b.radius_px();
  return a.light == b.light && ratio < kLikeRadius && ratio > 1.0 / kLikeRadius;
}

/// The nearest of some places, with the distance of the second nearest.
struct Nearest {
  int index = -1;
  double distance_px = kInfinite, second_px = kInfinite;

  void offer(int candidate, double candidate_px) {
    if (candidate_px < distance_px) {
      second_px = distance_px;
      distance_px = candidate_px;
      index = candidate;
    } else {
      second_px = std::min(second_px, candidate_px);
    }
  }
  bool clear() const { return index >= 0 && second_px > kClearer * distance_px; }
};

/// Distance of each place to the nearest other one.
std::vector<double> spacings(const std::vector<Vector2d>& places) {
  std::vector<double> result(places.size(), kInfinite);
  for (std::size_t i = 0; i < places.size(); ++i) {
    for (std::size_t j = 0; j < places.size(); ++j) {
      if (i != j) result[i] = std::min(result[i], (places[i] - places[j]).norm());
    }
  }
  return result;
}

class Follower {
 public:
  std::vector<int> next(const std::vector<Dot>& dots) {
    for (Track& track : tracks_) track.place += track.speed;
    const Vector2d shift = common_shift(dots);
    for (Track& track : tracks_) track.place += shift;
    correct_by_neighbours(dots, match(dots, kFirstReach));
    const std::vector<int> dot_of_track = match(dots, kReach);
    return take(dots, dot_of_track);
  }
  int count() const { return count_; }

 private:
  std::vector<Vector2d> places() const {
    std::vector<Vector2d> result;
    for (const Track& track : tracks_) result.push_back(track.place);
    return result;
  }

  /// The shift of all that brings most tracks to a dot; none unless it is clearly better than none.
  Vector2d common_shift(const std::vector<Dot>& dots) const {
    const std::vector<double> spacing = spacings(places());
    const auto hits = [&](const Vector2d& shift) {
      int count = 0;
      for (std::size_t i = 0; i < tracks_.size(); ++i) {
        const double reach = 0.25 * spacing[i];
        count += std::any_of(dots.begin(), dots.end(), [&](const Dot& dot) {
          return (tracks_[i].place + shift - dot.centre_px).squaredNorm() < reach * reach &&
                 alike(tracks_[i].dot, dot);
        });
      }
      return count;
    };
    Vector2d best = Vector2d::Zero();
    int most = hits(best) + static_cast<int>(tracks_.size()) / 5;
    for (const Track& track : tracks_) {
      for (const Dot& dot : dots) {
        if (!alike(track.dot, dot)) continue;
        const Vector2d shift = dot.centre_px - track.place;
        const int count = hits(shift);
        if (count < most || (count == most && shift.norm() >= best.norm())) continue;
        most = count;
        best = shift;
      }
    }
    return best;
  }

  /// Per track its dot or -1.
  std::vector<int> match(const std::vector<Dot>& dots, double reach) const {
    std::vector<Nearest> of_track(tracks_.size()), of_dot(dots.size());
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      for (std::size_t j = 0; j < dots.size(); ++j) {
        const double distance_px = (tracks_[i].place - dots[j].centre_px).norm();
        of_track[i].offer(static_cast<int>(j), distance_px);
        of_dot[j].offer(static_cast<int>(i), distance_px);
      }
    }
    const std::vector<double> spacing = spacings(places());
    std::vector<int> result(tracks_.size(), -1);
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      if (!of_track[i].clear() || !(of_track[i].distance_px < reach * spacing[i])) continue;
      const auto j = static_cast<std::size_t>(of_track[i].index);
      if (of_dot[j].index != static_cast<int>(i) || !of_dot[j].clear()) continue;
      if (alike(tracks_[i].dot, dots[j])) result[i] = of_track[i].index;
    }
    return result;
  }

  /// Moves each place by what the nearest matched tracks were off.
  void correct_by_neighbours(const std::vector<Dot>& dots, const std::vector<int>& dot_of_track) {
    std::vector<Vector2d> from, off;
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      if (dot_of_track[i] < 0) continue;
      from.push_back(tracks_[i].place);
      off.push_back(dots[static_cast<std::size_t>(dot_of_track[i])].centre_px - tracks_[i].place);
    }
    if (from.empty()) return;
    for (Track& track : tracks_) {
      std::vector<std::pair<double, std::size_t>> order;
      for (std::size_t k = 0; k < from.size(); ++k) {
        order.emplace_back((from[k] - track.place).squaredNorm(), k);
      }
      std::sort(order.begin(), order.end());
      order.resize(std::min<std::size_t>(order.size(), kNeighbours));
      // The median withstands one neighbour's false match.
      std::vector<double> x, y;
      for (const auto& [distance, k] : order) {
        x.push_back(off[k].x());
        y.push_back(off[k].y());
      }
      const auto median = [](std::vector<double>& values) {
        std::sort(values.begin(), values.end());
        return values[values.size() / 2];
      };
      track.place += Vector2d(median(x), median(y));
    }
  }

  std::vector<int> take(const std::vector<Dot>& dots, const std::vector<int>& dot_of_track) {
    std::vector<int> track_of_dot(dots.size(), -1);
    std::vector<Track> alive;
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      Track track = tracks_[i];
      if (dot_of_track[i] < 0) {
        if (++track.missed <= kMostMissed) alive.push_back(track);
        continue;
      }
      const Dot& dot = dots[static_cast<std::size_t>(dot_of_track[i])];
      track.speed = (dot.centre_px - track.dot.centre_px) / (track.missed + 1);
      track.dot = dot;
      track.place = dot.centre_px;
      track.missed = 0;
      track_of_dot[static_cast<std::size_t>(dot_of_track[i])] = track.id;
      alive.push_back(track);
    }
    for (std::size_t j = 0; j < dots.size(); ++j) {
      if (track_of_dot[j] >= 0) continue;
      // A track in doubt ends where a new one begins; both would stay in doubt for ever.
      alive.erase(std::remove_if(alive.begin(), alive.end(),
                                 [&](const Track& track) {
                                   return track.missed > 0 &&
                                          (track.place - dots[j].centre_px).norm() <
                                              kClearer * dots[j].major_px;
                                 }),
                  alive.end());
      track_of_dot[j] = count_;
      alive.push_back({count_++, dots[j], dots[j].centre_px, Vector2d::Zero(), 0});
    }
    tracks_ = std::move(alive);
    return track_of_dot;
  }

  std::vector<Track> tracks_;
  int count_ = 0;
};

}  // namespace

DotTracks follow_dots(const std::vector<std::vector<Dot>>& pictures) {
  Follower follower;
  DotTracks tracks;
  for (const std::vector<Dot>& dots : pictures) tracks.track_of_dot.push_back(follower.next(dots));
  tracks.count = follower.count();
  return tracks;
}

}  // namespace semblance
