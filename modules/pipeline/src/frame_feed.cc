#include "semblance/pipeline/frame_feed.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <vector>

namespace semblance {

namespace {

using Clock = std::chrono::steady_clock;

/// Where each pixel of the undistorted picture lies in the distorted one.
class Undistortion {
 public:
  explicit Undistortion(const Camera& camera) : camera_(camera) {
    if (camera.lens == Lens::pinhole) return;
    const Camera straight = camera.without_distortion();
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        places_.push_back(project(camera, unproject(straight, {x + 0.5, y + 0.5})).cast<float>());
      }
    }
  }
  void apply(Image& image) const {
    if (places_.empty()) return;
    Image out(image.width, image.height, 3);
    for (std::size_t i = 0; i < places_.size(); ++i) {
      sample_bilinear(image, places_[i].x(), places_[i].y(), out.data.data() + 3 * i);
    }
    image = std::move(out);
  }
  bool active() const { return !places_.empty(); }

 private:
  Camera camera_;
  std::vector<Eigen::Vector2f> places_;
};

}  // namespace

struct FrameFeed::Impl {
 public:
  Impl(const std::string& video, const Camera& camera, int levels, int first_tracked)
      : video_(video),
        undistortion_(camera),
        levels_(levels),
        first_tracked_(first_tracked),
        thread_([this] { run(); }) {}
  ~Impl() {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = true;
      changed_.notify_all();
    }
    thread_.join();
  }

  std::optional<PreparedFrame> next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !ready_.empty() || ended_; });
    if (ready_.empty()) {
      if (error_) std::rethrow_exception(error_);
      return std::nullopt;
    }
    PreparedFrame frame = std::move(ready_.front());
    ready_.pop_front();
    changed_.notify_all();
    return frame;
  }
  double busy_s() const { return busy_s_; }

 private:
  static constexpr std::size_t kAhead = 6;

  void run() {
    try {
      while (true) {
        const auto begin = Clock::now();
        PreparedFrame frame;
        frame.index = video_.position();
        if (!video_.next(frame.picture)) break;
        if (frame.index >= first_tracked_ || undistortion_.active()) {
          Image linear = linear_from_rgb8(frame.picture);
          if (undistortion_.active()) {
            undistortion_.apply(linear);
            frame.picture = rgb8_from_linear(linear);
          }
          if (frame.index >= first_tracked_) {
            frame.observation = make_observation(std::move(linear), levels_);
          }
        }
        busy_s_ = busy_s_ + std::chrono::duration<double>(Clock::now() - begin).count();
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return ready_.size() < kAhead || stopped_; });
        if (stopped_) break;
        ready_.push_back(std::move(frame));
        changed_.notify_all();
      }
    } catch (...) {
      error_ = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    ended_ = true;
    changed_.notify_all();
  }

  VideoSource video_;
  Undistortion undistortion_;
  int levels_, first_tracked_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<PreparedFrame> ready_;
  bool ended_ = false, stopped_ = false;
  std::exception_ptr error_;
  std::atomic<double> busy_s_{0.0};
  std::thread thread_;  // last: starts when all else is there
};

FrameFeed::FrameFeed(const std::string& video, const Camera& camera, int levels, int first_prepared)
    : impl_(std::make_unique<Impl>(video, camera, levels, first_prepared)) {}
FrameFeed::~FrameFeed() = default;
std::optional<PreparedFrame> FrameFeed::next() { return impl_->next(); }
double FrameFeed::busy_s() const { return impl_->busy_s(); }

}  // namespace semblance
