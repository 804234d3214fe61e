#include "semblance/lips/track_lips.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>

#include "face_lips.h"
#include "median.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/face/track_face.h"
#include "semblance/lips/complete_track.h"
#include "semblance/lips/lip_overlay.h"
#include "semblance/lips/lip_tracker.h"
#include "semblance/pipeline/background_queue.h"
#include "semblance/pipeline/contact_sheet.h"
#include "semblance/pipeline/report.h"

namespace semblance {

namespace fs = std::filesystem;

namespace {

using Clock = std::chrono::steady_clock;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kAssumedRate = 25.0;  // of a folder of images, as the tracking loop assumes it

double rate_of(const VideoInfo& info) {
  return info.frames_per_second > 0.0 ? info.frames_per_second : kAssumedRate;
}

/// NaN where no value is finite.
double median_of_finite(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  return values.empty() ? kNan : median(std::move(values));
}

TrackHeader header_for(const LipTrackingOptions& options, const VideoInfo& info) {
  TrackHeader header;
  header.kind = "lips";
  header.width = info.width;
  header.height = info.height;
  header.config = {{"video", fs::path(options.video).filename().string()},
                   {"markers", options.markers},
                   {"velocity_frames", options.velocity_frames}};
  return header;
}

/// The forward pass over painted dots. Leaves nothing where no frame shows them.
std::vector<LipEstimate> follow_dots(const LipTrackingOptions& options, const VideoInfo& info,
                                     const TrackHeader& header, TrackingOutcome& outcome,
                                     Progress& progress) {
  const bool made = prepare_output_folder(options.folder);
  const fs::path results = fs::path(options.folder) / "track.jsonl";
  TrackingRun run;
  run.video = options.video;
  run.folder = options.folder;
  run.camera = Camera::centred(info.width, info.height, kDefaultFocal * info.width);
  run.header = header;
  run.resume = options.resume;
  run.last_frame = options.last_frame;
  LipTracker tracker(options.markers);
  const auto forget = [&] {
    std::error_code ignored;
    if (made) fs::remove_all(options.folder, ignored);
    fs::remove(results, ignored);
    fs::remove(fs::path(options.folder) / "checkpoint.bin", ignored);
  };
  try {
    outcome = run_tracking(
        run, tracker, [](const Rgb8&, const TrackFrame&) {}, progress);
  } catch (...) {
    if (made && !fs::exists(results)) forget();
    throw;
  }
  if (outcome.tracked == 0) {
    forget();
    if (outcome.cancelled) throw SolverError("interrupted before any markers were found");
    throw SolverError(
        options.video + ": no markers found in any of its " + std::to_string(outcome.frames) +
        " frames; in some frame all " + std::to_string(options.markers) +
        " dots must be seen at once, of one colour that differs from lips and skin, 3 pixels wide "
        "or more, around an upright mouth; --markers none follows lips without dots");
  }
  std::vector<LipEstimate> track;
  for (const TrackFrame& frame : read_track(results.string()).frames) {
    track.push_back(from_track_frame(frame, options.markers, results.string()));
  }
  return track;
}

/// The lips of the face tracker, which leaves all that it makes in a folder of its own.
std::vector<LipEstimate> follow_face(const LipTrackingOptions& options, TrackingOutcome& outcome,
                                     Progress& progress) {
  prepare_output_folder(options.folder);
  FaceTrackingOptions face;
  face.video = options.video;
  face.folder = (fs::path(options.folder) / "face").string();
  face.resume = options.resume;
  face.overlay = options.overlay;
  face.last_frame = options.last_frame;
  try {
    outcome = track_face(face, progress).outcome;
  } catch (...) {
    std::error_code ignored;  // removes it only if it is empty
    if (fs::is_empty(options.folder, ignored)) fs::remove(options.folder, ignored);
    throw;
  }
  const std::string results = (fs::path(face.folder) / "track.jsonl").string();
  return lips_of_face(read_track(results), results);
}

/// Replaces track.jsonl by the completed track.
void write_track(const fs::path& folder, const TrackHeader& header,
                 const std::vector<LipEstimate>& track) {
  const fs::path path = folder / "track.jsonl", partial = folder / "track.jsonl.partial";
  {
    TrackWriter writer(partial.string(), header);
    for (const LipEstimate& estimate : track) writer.write(to_track_frame(estimate));
  }
  fs::rename(partial, path);
}

/// Draws the frames on a second thread while they are decoded.
ContactSheet write_overlay(const LipTrackingOptions& options, const VideoInfo& info,
                           const std::vector<LipEstimate>& track, Progress& progress) {
  ContactSheet pictures;
  LipPainter painter;
  const int scale = LipPainter::scale(info.width);
  VideoWriter video((fs::path(options.folder) / "overlay.mp4").string(), scale * info.width,
                    scale * info.height, rate_of(info));
  struct Job {
    Rgb8 frame;
    const LipEstimate* estimate;
  };
  BackgroundQueue<Job> queue(8, [&](Job& job) {
    const Rgb8 picture = painter.paint(job.frame, *job.estimate);
    pictures.add(picture, to_track_frame(*job.estimate));
    video.write(picture);
  });
  VideoSource source(options.video);
  progress.begin("drawing", static_cast<std::int64_t>(track.size()));
  for (std::size_t i = 0; i < track.size(); ++i) {
    Rgb8 frame;
    if (!source.next(frame)) break;
    queue.push({std::move(frame), &track[i]});
    progress.update(static_cast<std::int64_t>(i + 1));
  }
  queue.finish();
  video.close();
  progress.end();
  return pictures;
}

void write_lip_report(const LipTrackingOptions& options, const std::vector<LipEstimate>& track,
                      const TrackingOutcome& outcome, double wall_s, ContactSheet pictures) {
  const fs::path folder(options.folder);
  ReportInput report;
  report.title = fs::path(options.video).filename().string();
  report.track = read_track((folder / "track.jsonl").string());
  report.stages = {{"decoding", outcome.times.decode_s}, {"tracking", outcome.times.track_s}};
  report.wall_s = wall_s;
  report.pictures = std::move(pictures);
  ReportCurve opening{"Mouth opening (middles of the lips over corners)", "", {}, true};
  ReportCurve seen{"Markers seen", "", {}, true}, confidence{"Confidence", "", {}, true};
  for (const LipEstimate& estimate : track) {
    opening.values.push_back(mouth_opening(estimate));
    seen.values.push_back(static_cast<double>(
        std::count_if(estimate.markers.begin(), estimate.markers.end(),
                      [](const auto& m) { return m.marker.state == MarkerState::seen; })));
    confidence.values.push_back(estimate.confidence);
  }
  report.curves = {opening, seen, confidence};
  write_report((folder / "report.html").string(), report);
}

void count_markers(const std::vector<LipEstimate>& track, LipTrackingSummary& summary) {
  std::vector<double> sigmas, openings;
  for (const LipEstimate& estimate : track) {
    openings.push_back(mouth_opening(estimate));
    for (const TrackedMarker& m : estimate.markers) {
      summary.seen += m.marker.state == MarkerState::seen ? 1 : 0;
      summary.bridged += m.marker.state == MarkerState::bridged ? 1 : 0;
      summary.absent += m.known() ? 0 : 1;
      if (m.marker.state == MarkerState::seen && m.sigma_px.minCoeff() >= 0.0) {
        sigmas.push_back(std::sqrt(0.5 * m.sigma_px.squaredNorm()));
      }
    }
  }
  summary.median_sigma_px = median_of_finite(std::move(sigmas));
  summary.median_opening = median_of_finite(std::move(openings));
}

}  // namespace

LipTrackingSummary track_lips(const LipTrackingOptions& options, Progress& progress) {
  const auto begin = Clock::now();
  const VideoInfo info = VideoSource(options.video).info();
  const TrackHeader header = header_for(options, info);
  LipTrackingSummary summary;
  std::vector<LipEstimate> track =
      options.markers == 0 ? follow_face(options, summary.outcome, progress)
                           : follow_dots(options, info, header, summary.outcome, progress);
  bridge_gaps(track);
  add_velocities(track, options.velocity_frames);
  const fs::path folder(options.folder);
  write_track(folder, header, track);
  write_lip_markers((folder / "lips.csv").string(),
                    to_lip_track(track, static_cast<int>(track.front().markers.size())));
  ContactSheet pictures;
  if (options.overlay) pictures = write_overlay(options, info, track, progress);
  const double wall_s = std::chrono::duration<double>(Clock::now() - begin).count();
  write_lip_report(options, track, summary.outcome, wall_s, std::move(pictures));
  count_markers(track, summary);
  return summary;
}

}  // namespace semblance
