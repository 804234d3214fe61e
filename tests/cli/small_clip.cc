#include "small_clip.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <filesystem>
#include <stdexcept>

namespace semblance::testing {

namespace fs = std::filesystem;

namespace {

FaceClipSpec recipe() {
  FaceClipSpec spec;
  spec.name = "small";
  spec.seed = 7;
  spec.density = 1.2;
  spec.frames = kSmallClipFrames;
  spec.width = kSmallClipWidth;
  spec.height = kSmallClipHeight;
  spec.focal_px = 400.0;
  spec.motion.yaw_deg = 10.0;
  spec.motion.pitch_deg = 5.0;
  spec.motion.distance_range_m = 0.03;
  spec.motion.sideways_m = 0.02;
  spec.look.clutter = false;
  return spec;
}

/// CTest runs every case as a process of its own: one of them makes the clip, the others wait.
class FileLock {
 public:
  explicit FileLock(const fs::path& path) : file_(open(path.c_str(), O_CREAT | O_RDWR, 0600)) {
    if (file_ < 0 || flock(file_, LOCK_EX) != 0) {
      throw std::runtime_error(path.string() + ": cannot be locked");
    }
  }
  ~FileLock() { close(file_); }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  int file_;
};

}  // namespace

ClipFiles small_clip() {
  const fs::path shared(SEMBLANCE_TEST_INPUTS);
  fs::create_directories(shared);
  const FileLock lock(shared / "small.lock");
  const fs::path clip = shared / "small", truth = clip / "truth.jsonl";
  if (fs::exists(truth) && fs::last_write_time(truth) > fs::last_write_time("/proc/self/exe")) {
    return clip_files(clip.string());
  }
  return generate_clip(recipe(), clip.string());
}

}  // namespace semblance::testing
