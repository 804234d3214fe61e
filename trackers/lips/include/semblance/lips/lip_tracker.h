// Follows dots painted on lips through a video, frame by frame.
#pragma once

#include <iosfwd>
#include <optional>
#include <vector>

#include "semblance/lips/dots.h"
#include "semblance/lips/lip_estimate.h"
#include "semblance/pipeline/tracking_run.h"

namespace semblance {

/// The device of the ATR report (1993, section 4.2) in software: 8 or 16 dots of one colour, any
/// that differs from lips and skin. The first frame that shows them all, in the arrangement of a
/// mouth (find_constellation), names them and teaches their look. From then on candidates of that
/// look are sought around the predicted mouth; where all are seen their arrangement names them
/// again, in every frame, so that no identity can drift; where some are hidden the others are
/// matched to the prediction at least total cost (Kuhn 1955), and what breaks the order of a mouth
/// is dropped. Each dot is then measured by fit_dot. With fewer than three dots the frame is lost,
/// and the whole arrangement is sought again.
class LipTracker : public FrameTracker {
 public:
  /// 8 or 16 markers.
  explicit LipTracker(int marker_count);

  /// The next frame, in linear RGB. Markers not seen in it are absent. Its confidence is the part
  /// of the markers that is seen, times their mean contrast relative to the learned one (at most
  /// 1).
  LipEstimate follow(int frame, double time_s, const Image& linear_rgb);

  TrackFrame track(int frame, double time_s, const Observation& observation) override;
  int pyramid_levels() const override { return 0; }
  void save_state(std::ostream& out) const override;
  void restore_state(std::istream& in, const std::string& source) override;

  /// True once the markers were found.
  bool has_markers() const { return look_.has_value(); }

 private:
  struct Followed {
    Eigen::Vector2d position_px = Eigen::Vector2d::Zero();  // last seen, carried on while hidden
    Eigen::Vector2d whole_px = Eigen::Vector2d::Zero();     // when all were last seen
    Eigen::Vector2d step_px = Eigen::Vector2d::Zero();      // per frame
    double height = 0.0;    // the dot's usual contrast; 0: not known yet
    int hidden_frames = 0;  // up to and with the last one
    bool sure = true;       // seen in every frame since all were
  };
  using Fits = std::vector<std::optional<DotFit>>;

  Fits acquire(const Image& linear_rgb);
  Fits advance(const Image& linear_rgb);
  Fits fit_constellation(const Patch& patch, const std::vector<Spot>& dots) const;
  Fits fit_matched(const Patch& patch, const std::vector<DotCandidate>& candidates) const;
  std::optional<DotFit> measure(const Patch& patch, const Eigen::Vector2d& start_px,
                                double usual_height) const;
  std::vector<Eigen::Vector2d> predict(const std::vector<DotCandidate>& candidates,
                                       std::vector<int>& matched) const;
  void drop_ambiguous(const std::vector<Eigen::Vector2d>& predicted_px, Fits& fits) const;
  void remember(const Fits& fits, bool anew);
  std::vector<Eigen::Vector2d> with_hidden(std::vector<Eigen::Vector2d> places_px,
                                           const std::vector<bool>& known) const;
  void check_names(const std::vector<DotCandidate>& candidates,
                   std::vector<Eigen::Vector2d>& predicted, std::vector<int>& matched) const;
  std::vector<double> gates_px(double share_of_width) const;
  double mouth_width_px() const;
  LipEstimate estimate(const Fits& fits) const;

  int count_;
  std::optional<DotLook> look_;
  double usual_residual_ = 0.0;  // of the fits of whole dots
  bool following_ = false;
  int lost_frames_ = 0;
  std::vector<Followed> followed_;
};

}  // namespace semblance
