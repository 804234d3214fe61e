#include "face_clip.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "semblance/core/errors.h"
#include "semblance/pipeline/frame_feed.h"

namespace semblance {

namespace {

// Deviation of the change of velocity from frame to frame: heads accelerate slowly, lips do not.
constexpr double kRotationAcceleration = 0.01, kTranslationAcceleration_m = 0.002;
constexpr double kExpressionAcceleration = 0.1, kBlinkAcceleration = 0.5;
constexpr int kSmoothingRounds = 3;
constexpr int kFocalStep = 10, kFocalFrames = 60, kFocalCandidates = 9;

Eigen::VectorXd acceleration_sigma(const ParameterSpace& space) {
  Eigen::VectorXd sigma(space.tangent_size());
  sigma.head<3>().setConstant(kRotationAcceleration);
  sigma.segment<3>(3).setConstant(kTranslationAcceleration_m);
  for (std::size_t b = 2; b < space.blocks().size(); ++b) {
    const bool blink = space.blocks()[b].name.find("blink") != std::string::npos;
    sigma[space.tangent_offset(static_cast<int>(b))] =
        blink ? kBlinkAcceleration : kExpressionAcceleration;
  }
  return sigma;
}

constexpr std::size_t kMostKeyframes = 12, kLeastKeyframes = 3;
constexpr int kScannedFrames = 240;
constexpr double kKeyframeCorrelation = 0.78, kKeyframeTurn_rad = 0.07;

double turn_between(const Keyframe& a, const Keyframe& b) {
  return 2.0 * std::acos(std::min(1.0, std::abs(a.x.head<4>().dot(b.x.head<4>()))));
}

double nearest_turn(const std::vector<Keyframe>& all, std::size_t k) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i != k) least = std::min(least, turn_between(all[i], all[k]));
  }
  return least;
}

/// Adds a frame if it shows another side; one too many makes the least different one go.
void offer(Keyframe candidate, std::vector<Keyframe>& kept) {
  kept.push_back(std::move(candidate));
  if (kept.size() == 1) return;
  if (nearest_turn(kept, kept.size() - 1) < kKeyframeTurn_rad) {
    kept.pop_back();
  } else if (kept.size() > kMostKeyframes) {
    std::size_t worst = 1;
    for (std::size_t k = 2; k < kept.size(); ++k) {
      if (nearest_turn(kept, k) < nearest_turn(kept, worst)) worst = k;
    }
    kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(worst));
  }
}

/// Where a video is damaged, what comes before it still shows the face; tracking meets the damage
/// again and reports it.
std::optional<PreparedFrame> next_undamaged(FrameFeed& feed) {
  try {
    return feed.next();
  } catch (const InvalidInput&) {
    return std::nullopt;
  }
}

}  // namespace

std::vector<Keyframe> find_keyframes(const std::string& video, const Camera& camera,
                                     const MorphShape& shape, const FaceTrackerOptions& options,
                                     Progress& progress) {
  FaceTrackerOptions scanning = options;
  scanning.optimizer = "lm";
  FaceTracker tracker(shape, camera.without_distortion(), scanning);
  std::vector<Keyframe> kept;
  FrameFeed feed(video, camera, tracker.pyramid_levels(), 0);
  progress.begin("learning the face", kScannedFrames);
  while (std::optional<PreparedFrame> prepared = next_undamaged(feed)) {
    if (prepared->index >= kScannedFrames || progress.cancelled()) break;
    const TrackFrame frame = tracker.track(prepared->index, 0.0, prepared->observation);
    progress.update(prepared->index + 1);
    if (frame.status == TrackStatus::lost) continue;
    if (!kept.empty() && frame.extra.value("correlation", 0.0) < kKeyframeCorrelation) continue;
    offer({frame.frame, frame.x,
           std::make_shared<const Observation>(std::move(prepared->observation)),
           kept.empty() ? options.first_marks : std::vector<FaceMark>()},
          kept);
  }
  progress.end();
  if (kept.size() < kLeastKeyframes) kept.clear();
  return kept;
}

void smooth_track(const std::string& video, const FaceTracker& tracker, const Camera& camera,
                  std::vector<TrackFrame>& frames, Progress& progress) {
  const ParameterSpace& space = tracker.frame_parameters();
  ClipSmootherOptions options;
  options.acceleration_sigma = acceleration_sigma(space);
  options.longest_bridge = 0;  // a frame that was lost stays lost: nothing of it was seen
  for (int round = 0; round < kSmoothingRounds; ++round) {
    std::vector<ClipFrame> clip(frames.size());
    FrameFeed feed(video, camera, 1, 0);
    progress.begin(
        "smoothing, round " + std::to_string(round + 1) + " of " + std::to_string(kSmoothingRounds),
        static_cast<std::int64_t>(frames.size()));
    while (std::optional<PreparedFrame> prepared = feed.next()) {
      const auto index = static_cast<std::size_t>(prepared->index);
      if (index >= frames.size()) break;
      clip[index] = tracker.linearize(frames[index], prepared->observation);
      progress.update(prepared->index + 1);
      if (progress.cancelled()) return;
    }
    progress.end();
    const SmoothedClip smoothed = smooth_clip(space, clip, options, silent_progress());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      tracker.replace_estimate(smoothed.frames[i], frames[i]);
    }
  }
}

FocalEstimate estimate_focal(const std::string& video, const MorphShape& shape,
                             const FaceTrackerOptions& options, Progress& progress) {
  std::vector<Observation> observations;
  {
    VideoSource source(video);
    const Camera any = Camera::centred(source.info().width, source.info().height, 1.0);
    const int levels = FaceTracker(shape, any, options).pyramid_levels();
    Rgb8 picture;
    for (int i = 0; source.next(picture) && static_cast<int>(observations.size()) < kFocalFrames;
         ++i) {
      if (i % kFocalStep == 0) {
        observations.push_back(make_observation(linear_from_rgb8(picture), levels));
      }
    }
  }
  if (observations.empty()) throw InvalidInput(video + ": holds no frames");
  const double width = observations.front().linear.width;
  std::vector<double> log_focal(kFocalCandidates), residual(kFocalCandidates);
  progress.begin("estimating the focal length", kFocalCandidates);
  for (int c = 0; c < kFocalCandidates; ++c) {
    log_focal[c] = std::log(0.6 * width) + std::log(4.0) * c / (kFocalCandidates - 1);
    const Camera camera =
        Camera::centred(observations.front().linear.width, observations.front().linear.height,
                        std::exp(log_focal[c]));
    FaceTracker tracker(shape, camera, options);
    double sum = 0.0;
    for (std::size_t i = 0; i < observations.size(); ++i) {
      const TrackFrame frame = tracker.track(static_cast<int>(i), 0.0, observations[i]);
      // A lost frame counts like one in which nothing fits.
      sum += frame.status == TrackStatus::lost ? 0.3 : frame.residual_rms;
    }
    residual[c] = sum / static_cast<double>(observations.size());
    progress.update(c + 1);
    if (progress.cancelled()) break;
  }
  progress.end();
  // Least-squares parabola residual = a + b l + c l^2 around the best candidate.
  const auto best = std::min_element(residual.begin(), residual.end()) - residual.begin();
  const int first = std::clamp(static_cast<int>(best) - 2, 0, kFocalCandidates - 5);
  Eigen::Matrix<double, 5, 3> design;
  Eigen::Matrix<double, 5, 1> values;
  for (int i = 0; i < 5; ++i) {
    const double l = log_focal[first + i] - log_focal[best];
    design.row(i) << 1.0, l, l * l;
    values[i] = residual[first + i];
  }
  const Eigen::Vector3d fit = design.colPivHouseholderQr().solve(values);
  FocalEstimate out;
  out.focal_px = std::exp(log_focal[best]);
  out.sigma_px = std::numeric_limits<double>::infinity();
  if (fit[2] > 0.0 && best > 0 && best < kFocalCandidates - 1) {
    const double shift = std::clamp(-0.5 * fit[1] / fit[2], -0.2, 0.2);
    out.focal_px *= std::exp(shift);
    // The residual is a mean over frames: half a percent of it is what frames differ by chance.
    out.sigma_px = out.focal_px * std::sqrt(0.005 * residual[best] / fit[2]);
  }
  return out;
}

}  // namespace semblance
