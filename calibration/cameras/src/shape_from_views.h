// A shape and the places of its views, from nothing but which points the views share.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "semblance/cameras/survey.h"

namespace semblance {

/// A point of a view. Points of different views are one where their tracks are.
struct TrackedPoint {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  double spread = 1.0;
  int index = 0;  // the caller's own number of it
};
using TrackView = std::map<int, TrackedPoint>;  // by track

/// A shape with the poses of the views that it was made of.
struct Reconstruction {
  Camera camera;
  std::map<int, Rigid3> camera_from_object;  // by index of the view
  std::map<int, Eigen::Vector3d> points;     // by track
};

/// A reconstruction as a survey: `tracks`, `views` and `indices` say what its points, placements
/// and sightings are.
struct ShapeSurvey {
  Survey survey;
  std::vector<int> tracks, views, indices;
};

struct ShapeOptions {
  std::vector<double> focals_px;  // to be tried
  double accuracy_px = 1.0;       // of points: what fits within it is right
  int fewest_views = 3;           // of a point that counts
  std::function<bool()> cancelled;
};

/// Finds a shape by one camera. The start is the essential matrix of two views (Nister, "An
/// efficient solution to the five-point relative pose problem", PAMI 26, 2004), tried for a row of
/// focal lengths and pairs; further views and points are added in turn; all is adjusted together.
class ShapeFromViews {
 public:
  static constexpr std::size_t fewest_shared = 8;  // by two views

  /// `camera`: of all views; its focal length is sought.
  ShapeFromViews(Camera camera, std::vector<TrackView> views, ShapeOptions options);

  /// The most points that two views share.
  std::size_t most_shared() const;
  /// The start from which most points fit. Throws SolverError where none fits.
  Reconstruction best_start() const;
  /// Adds views to the shape, those with most known points first, and points to the views.
  void extend(Reconstruction& shape) const;
  /// After the joint adjustment; points that few sightings support, and views, are left out.
  /// Throws SolverError where too little is left.
  Reconstruction adjusted(const Reconstruction& shape, Lens lens) const;
  ShapeSurvey survey_of(const Reconstruction& shape) const;

  const std::vector<TrackView>& views() const { return views_; }

 private:
  struct Pair {
    int a, b;
    double score;
  };
  const TrackView& view(int index) const { return views_[static_cast<std::size_t>(index)]; }
  std::vector<int> shared(const TrackView& a, const TrackView& b) const;
  double parallax_px(const TrackView& a, const TrackView& b, const std::vector<int>& tracks) const;
  std::vector<Pair> start_pairs() const;
  bool start_from_pair(const Camera& camera, const Pair& pair, Reconstruction& shape) const;
  std::optional<Eigen::Vector3d> place_of(const Reconstruction& shape, int track) const;
  double error_px(const Reconstruction& shape, int index, int track,
                  const Eigen::Vector3d& point) const;
  void triangulate(Reconstruction& shape) const;
  std::optional<Rigid3> pose_of(const Reconstruction& shape, const TrackView& view) const;
  int good_sightings(const Reconstruction& shape) const;

  Camera camera_;
  std::vector<TrackView> views_;
  ShapeOptions options_;
};

}  // namespace semblance
