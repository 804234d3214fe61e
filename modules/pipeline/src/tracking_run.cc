#include "semblance/pipeline/tracking_run.h"

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>

#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/picture_size.h"
#include "semblance/pipeline/frame_feed.h"

namespace semblance {

namespace {

using Clock = std::chrono::steady_clock;
constexpr double kAssumedRate = 25.0;  // frames per second of a folder of images
constexpr char kCheckpointMagic[] = "semblance.checkpoint/1\n";

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// checkpoint.bin: magic, the number of frames done, then the tracker's state.
void save_checkpoint(const std::filesystem::path& path, std::int32_t frames_done,
                     const FrameTracker& tracker) {
  AtomicFile file(path);
  file.stream().write(kCheckpointMagic, sizeof kCheckpointMagic);
  file.stream().write(reinterpret_cast<const char*>(&frames_done), sizeof frames_done);
  tracker.save_state(file.stream());
  file.commit();
}

/// Number of frames done, 0 where there is no checkpoint.
int load_checkpoint(const std::filesystem::path& path, FrameTracker& tracker) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return 0;
  char magic[sizeof kCheckpointMagic] = {};
  std::int32_t frames_done = 0;
  in.read(magic, sizeof magic);
  in.read(reinterpret_cast<char*>(&frames_done), sizeof frames_done);
  if (!in || std::memcmp(magic, kCheckpointMagic, sizeof magic) != 0 || frames_done < 0) {
    throw InvalidInput(path.string() +
                       ": not a checkpoint of this version; run without --resume to start afresh");
  }
  tracker.restore_state(in, path.string());
  return frames_done;
}

/// The results so far, which have to be of the same settings.
Track read_results(const std::string& path, const TrackHeader& header) {
  Track track = read_track(path);
  if (track.header.value("config", nlohmann::json()) != header.config) {
    throw InvalidInput(path +
                       ": was made with other settings, so it cannot be resumed; use the same "
                       "options, or another output folder");
  }
  return track;
}

/// Cuts the result file after its header and `frames` lines and returns those frames.
std::vector<TrackFrame> cut_results(const std::string& path, Track track, std::size_t frames) {
  if (track.frames.size() < frames) {
    throw InvalidInput(path + ": has fewer frames than its checkpoint; run without --resume");
  }
  track.frames.resize(frames);
  std::ifstream in(path, std::ios::binary);
  std::string line;
  std::uintmax_t bytes = 0;
  for (std::size_t i = 0; i < frames + 1 && std::getline(in, line); ++i) bytes += line.size() + 1;
  in.close();
  std::filesystem::resize_file(path, bytes);
  return std::move(track.frames);
}

void count(const TrackFrame& frame, TrackingOutcome& outcome) {
  ++outcome.frames;
  if (frame.status == TrackStatus::lost) ++outcome.lost;
  if (frame.status != TrackStatus::lost) ++outcome.tracked;
  if (frame.status == TrackStatus::reinitialised) ++outcome.reinitialised;
}

}  // namespace

TrackingOutcome run_tracking(const TrackingRun& run, FrameTracker& tracker, const FrameSink& sink,
                             Progress& progress) {
  const auto begin = Clock::now();
  const VideoInfo info = VideoSource(run.video).info();
  require_camera_size(run.camera, info.width, info.height, run.video);
  const std::filesystem::path folder(run.folder);
  const std::string results = (folder / "track.jsonl").string();
  const std::filesystem::path checkpoint = folder / "checkpoint.bin";
  std::vector<TrackFrame> earlier;
  std::optional<TrackWriter> writer;
  if (run.resume && std::filesystem::exists(results)) {
    Track track = read_results(results, run.header);
    if (std::filesystem::exists(checkpoint)) {
      const int done = load_checkpoint(checkpoint, tracker);
      earlier = cut_results(results, std::move(track), static_cast<std::size_t>(done));
      writer.emplace(TrackWriter::append(results));
    }
  } else {
    std::filesystem::remove(checkpoint);
  }

  const int first = static_cast<int>(earlier.size());
  FrameFeed feed(run.video, run.camera, tracker.pyramid_levels(), first);
  const double rate = info.frames_per_second > 0.0 ? info.frames_per_second : kAssumedRate;
  TrackingOutcome outcome;
  bool stopped = false;  // before the end of the video
  progress.begin("tracking", info.frame_count);
  while (std::optional<PreparedFrame> frame = feed.next()) {
    if (frame->index < first) {
      count(earlier[static_cast<std::size_t>(frame->index)], outcome);
      sink(frame->picture, earlier[static_cast<std::size_t>(frame->index)]);
      continue;
    }
    stopped = run.last_frame >= 0 && frame->index > run.last_frame;
    if (stopped) break;
    const auto frame_begin = Clock::now();
    const double time_s = frame->index / rate;
    const TrackFrame result = tracker.track(frame->index, time_s, frame->observation);
    outcome.times.track_s += seconds_since(frame_begin);
    // Made with the first result, so that input which cannot be tracked at all leaves nothing.
    if (!writer) writer.emplace(results, run.header);
    writer->write(result);
    count(result, outcome);
    sink(frame->picture, result);
    progress.update(outcome.frames);
    if (progress.cancelled()) outcome.cancelled = true;
    if (outcome.cancelled || outcome.frames % run.checkpoint_every == 0) {
      save_checkpoint(checkpoint, outcome.frames, tracker);
    }
    if (outcome.cancelled) break;
  }
  progress.end();
  if (outcome.frames == 0) {
    throw InvalidInput(run.video + ": holds no frames; check that it plays in a video player");
  }
  outcome.times.decode_s = feed.busy_s();
  outcome.times.total_s = seconds_since(begin);
  // A later --resume can go on after last_frame, but not after the end.
  if (stopped) {
    save_checkpoint(checkpoint, outcome.frames, tracker);
  } else if (!outcome.cancelled) {
    std::filesystem::remove(checkpoint);
  }
  return outcome;
}

}  // namespace semblance
