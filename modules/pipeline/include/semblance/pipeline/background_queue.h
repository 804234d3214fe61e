// Work that overlaps with the loop that produces it.
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace semblance {

/// Hands jobs to one consumer on a thread of its own, in the order of `push`, holding at most
/// `capacity` of them. What the consumer throws ends the work: jobs still waiting are dropped and
/// the exception is rethrown by every later `push` and `finish`. Destruction without `finish` drops
/// waiting jobs. One producer thread.
template <class Job>
class BackgroundQueue {
 public:
  BackgroundQueue(std::size_t capacity, std::function<void(Job&)> consume)
      : capacity_(capacity), consume_(std::move(consume)), thread_([this] { run(); }) {}
  BackgroundQueue(const BackgroundQueue&) = delete;
  BackgroundQueue& operator=(const BackgroundQueue&) = delete;
  ~BackgroundQueue() {
    {
      const std::lock_guard lock(mutex_);
      jobs_.clear();
    }
    stop();
  }

  /// Waits while the queue is full.
  void push(Job job) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return jobs_.size() < capacity_ || error_; });
    if (error_) std::rethrow_exception(error_);
    jobs_.push_back(std::move(job));
    changed_.notify_all();
  }

  /// Waits until every job is done. Nothing may be pushed afterwards.
  void finish() {
    stop();
    if (error_) std::rethrow_exception(error_);
  }

 private:
  void stop() {
    {
      const std::lock_guard lock(mutex_);
      finished_ = true;
      changed_.notify_all();
    }
    if (thread_.joinable()) thread_.join();
  }

  void run() {
    while (true) {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return !jobs_.empty() || finished_; });
      if (jobs_.empty()) return;
      Job job = std::move(jobs_.front());
      jobs_.pop_front();
      changed_.notify_all();
      lock.unlock();
      try {
        consume_(job);
      } catch (...) {
        lock.lock();
        error_ = std::current_exception();
        jobs_.clear();
        changed_.notify_all();
        return;
      }
    }
  }

  std::size_t capacity_;
  std::function<void(Job&)> consume_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  bool finished_ = false;
  std::exception_ptr error_;
  std::thread thread_;  // last: starts when all else is there
};

}  // namespace semblance
