#include "semblance/face/track_face.h"

#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <utility>

#include "face_clip.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/core/pack_uvs.h"
#include "semblance/face/face_tracker.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/picture_size.h"
#include "semblance/io/points.h"
#include "semblance/models/load_face.h"
#include "semblance/pipeline/contact_sheet.h"
#include "semblance/pipeline/face_export.h"
#include "semblance/pipeline/frame_feed.h"
#include "semblance/pipeline/overlay.h"
#include "semblance/pipeline/report.h"

namespace semblance {

namespace fs = std::filesystem;

namespace {

Camera camera_for(const FaceTrackingOptions& options, const VideoInfo& info,
                  std::vector<std::string>& notes) {
  if (!options.camera.empty()) {
    Rgb8 first;
    VideoSource(options.video).next(first);
    Camera camera = read_camera(options.camera);
    const std::string name = std::exchange(camera.name, options.camera);  // for messages
    camera = camera_for_pictures(camera, first, options.video, notes);
    camera.name = name;
    return camera;
  }
  const double focal =
      options.focal_px > 0.0 ? options.focal_px : kDefaultFocal * std::max(info.width, info.height);
  return Camera::centred(info.width, info.height, focal);
}

/// With all of its texture in one unit square, as one picture holds it.
MorphShape load_tracked_face(const std::string& model) {
  MorphShape shape = load_face(model);
  Mesh mesh = *shape.mesh;
  pack_uvs(mesh, model);
  shape.mesh = std::make_shared<const Mesh>(std::move(mesh));
  return shape;
}

/// The 68 marks as landmarks of the model; the jaw line is marked less exactly than the rest.
std::vector<FaceMark> marks_from(const std::string& path, std::size_t landmark_count,
                                 const Camera& camera) {
  const std::vector<Eigen::Vector2d> points = read_points(path);
  if (points.size() != landmark_count || landmark_count != 68) {
    throw InvalidInput(path + ": has " + std::to_string(points.size()) +
                       " points, but 68 in the order of iBUG 300-W are needed (the model has " +
                       std::to_string(landmark_count) + " landmarks)");
  }
  const double eyes_px = (points[45] - points[36]).norm();
  std::vector<FaceMark> marks;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!(points[i].x() >= 0 && points[i].y() >= 0 && points[i].x() <= camera.width &&
          points[i].y() <= camera.height)) {
      throw InvalidInput(path + ": point " + std::to_string(i) + " lies outside the picture");
    }
    const double share = i < 17 ? 0.06 : 0.02;
    marks.push_back({static_cast<int>(i), points[i], std::max(0.5, share * eyes_px)});
  }
  return marks;
}

TrackHeader header_for(const FaceTrackingOptions& options, const FaceTracker& tracker,
                       const Camera& camera) {
  TrackHeader header;
  header.kind = "face";
  header.seed = options.seed;
  header.parameters = tracker.parameters();
  header.cameras = {camera};
  header.width = camera.width;
  header.height = camera.height;
  header.landmark_names = tracker.landmark_names();
  header.config = {{"video", fs::path(options.video).filename().string()},
                   {"model", options.model},
                   {"optimizer", options.optimizer},
                   {"points", fs::path(options.points).filename().string()},
                   {"focal_px", camera.focal_px.x()},
                   {"face", options.face ? nlohmann::json(*options.face) : nlohmann::json()},
                   {"smooth", options.smooth}};
  return header;
}

/// Smooths the forward pass and replaces track.jsonl by the result.
void smooth_results(const std::string& video, const FaceTracker& tracker, const Camera& camera,
                    const TrackHeader& header, const fs::path& folder, Progress& progress) {
  const std::string path = (folder / "track.jsonl").string();
  std::vector<TrackFrame> frames = read_track(path).frames;
  smooth_track(video, tracker, camera, frames, progress);
  const std::string partial = (folder / "track.smooth.partial").string();
  TrackWriter writer(partial, header);
  for (const TrackFrame& frame : frames) writer.write(frame);
  fs::rename(partial, path);
  fs::remove(folder / "checkpoint.bin");  // belongs to the forward pass
}

}  // namespace

FaceTrackingSummary track_face(const FaceTrackingOptions& options, Progress& progress) {
  const auto begin = std::chrono::steady_clock::now();
  const VideoInfo info = VideoSource(options.video).info();
  const MorphShape shape = load_tracked_face(options.model);
  FaceTrackerOptions tracking;
  tracking.optimizer = options.optimizer;
  tracking.seed = options.seed;
  tracking.face = options.face;
  FaceTrackingSummary summary;
  Camera camera = camera_for(options, info, summary.notes);
  if (options.estimate_focal && options.camera.empty()) {
    const FocalEstimate focal = estimate_focal(options.video, shape, tracking, progress);
    camera.focal_px.setConstant(focal.focal_px);
    summary.focal_sigma_px = focal.sigma_px;
  }
  if (!options.points.empty()) {
    tracking.first_marks = marks_from(options.points, shape.landmarks.size(), camera);
  }
  FaceTracker tracker(shape, camera.without_distortion(), tracking);
  const bool goes_on = options.resume && fs::exists(fs::path(options.folder) / "track.jsonl") &&
                       fs::exists(fs::path(options.folder) / "checkpoint.bin");
  if (!goes_on) {  // a checkpoint knows the person
    const std::vector<Keyframe> keyframes =
        find_keyframes(options.video, camera, shape, tracking, progress);
    if (progress.cancelled()) {
      throw SolverError("interrupted while the face was learned: nothing was written");
    }
    if (!keyframes.empty()) tracker.learn_person(keyframes);
  }
  prepare_output_folder(options.folder);
  const fs::path folder(options.folder);

  TrackingRun run;
  run.video = options.video;
  run.folder = options.folder;
  run.camera = camera;
  run.header = header_for(options, tracker, camera);
  run.resume = options.resume;
  run.last_frame = options.last_frame;
  run.checkpoint_every = options.checkpoint_every;

  ContactSheet pictures(info.width);
  const double rate = info.frames_per_second > 0.0 ? info.frames_per_second : 25.0;
  std::optional<OverlayWriter> overlay;
  if (options.overlay) {
    overlay.emplace(
        (folder / "overlay.mp4").string(), camera.without_distortion(), rate,
        [&](const Rgb8& picture, const TrackFrame& track) { pictures.add(picture, track); });
  }
  Scene scene;
  const FrameSink draw = [&](const Rgb8& picture, const TrackFrame& frame) {
    if (!overlay) return;
    if (frame.status != TrackStatus::lost) tracker.pose_scene(frame, scene);
    overlay->write(picture, scene, frame);
  };
  // A smoothed clip is drawn when it is smooth.
  const FrameSink sink = options.smooth ? FrameSink([](const Rgb8&, const TrackFrame&) {}) : draw;

  summary.focal_px = camera.focal_px.x();
  summary.outcome = run_tracking(run, tracker, sink, progress);
  if (options.smooth && !summary.outcome.cancelled && tracker.has_identity()) {
    smooth_results(options.video, tracker, camera, run.header, folder, progress);
  }
  const Track track = read_track((folder / "track.jsonl").string());
  if (options.smooth && !summary.outcome.cancelled) {
    int index = 0;
    FrameFeed feed(options.video, camera, 0, std::numeric_limits<int>::max());
    while (std::optional<PreparedFrame> frame = feed.next()) {
      if (index >= static_cast<int>(track.frames.size())) break;
      draw(frame->picture, track.frames[static_cast<std::size_t>(index++)]);
    }
  }
  if (overlay) overlay->close();
  write_track_csv((folder / "track.csv").string(), track);
  if (tracker.has_identity()) {
    write_face_glb((folder / "face.glb").string(), shape, tracker.texture(), track);
  }
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  summary.frames_per_second = summary.outcome.frames / wall_s;
  ReportInput report;
  report.title = fs::path(options.video).filename().string();
  report.track = track;
  report.stages = {{"decoding and pyramids", summary.outcome.times.decode_s},
                   {"tracking", summary.outcome.times.track_s}};
  report.wall_s = wall_s;
  report.pictures = std::move(pictures);
  write_report((folder / "report.html").string(), report);
  if (summary.outcome.tracked == 0 && !summary.outcome.cancelled) {
    throw SolverError(options.video + ": no face was found in any of its " +
                      std::to_string(summary.outcome.frames) +
                      " frames; the face should be at least 60 pixels wide and look towards the "
                      "camera in some frame, or be marked with --points");
  }
  return summary;
}

}  // namespace semblance
