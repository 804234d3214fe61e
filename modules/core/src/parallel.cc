#include "semblance/core/parallel.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <memory>
#include <mutex>
#include <string>

#include "semblance/core/errors.h"

// The installed TBB is not built for the thread sanitizer, which so misses the order that TBB puts
// between the caller and the loop bodies. This file is compiled without it (CMakeLists.txt), states
// that order by hand, and leaves out what TBB calls itself. Other builds have no such functions.
// NOLINTBEGIN(readability-identifier-naming)
extern "C" {
[[gnu::weak]] void __tsan_acquire(void* address);
[[gnu::weak]] void __tsan_release(void* address);
const char* __tsan_default_suppressions() { return "called_from_lib:libtbb.so\n"; }
}
// NOLINTEND(readability-identifier-naming)

namespace semblance {
namespace {

struct Pool {
  explicit Pool(int thread_count)
      : threads(thread_count),
        limit(tbb::global_control::max_allowed_parallelism, thread_count),
        arena(thread_count) {}
  int threads;
  tbb::global_control limit;  // lifts TBB's own limit where more threads than cores are wanted
  tbb::task_arena arena;
};

std::mutex pool_mutex;
std::shared_ptr<Pool> current_pool;

std::shared_ptr<Pool> pool() {
  const std::lock_guard lock(pool_mutex);
  if (!current_pool) current_pool = std::make_shared<Pool>(tbb::info::default_concurrency());
  return current_pool;
}

void acquire_for_sanitizer(void* address) {
  if (__tsan_acquire != nullptr) __tsan_acquire(address);
}

void release_for_sanitizer(void* address) {
  if (__tsan_release != nullptr) __tsan_release(address);
}

}  // namespace

void set_thread_count(int count) {
  if (count < 0) {
    throw InvalidInput("the number of threads must be 0 (all cores) or more, not " +
                       std::to_string(count));
  }
  auto next = std::make_shared<Pool>(count == 0 ? tbb::info::default_concurrency() : count);
  const std::lock_guard lock(pool_mutex);
  current_pool.swap(next);  // work under way keeps the old pool until it is done
}

int thread_count() { return pool()->threads; }

void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  const std::shared_ptr<Pool> workers = pool();
  if (count <= 1 || workers->threads == 1) {
    for (std::size_t i = 0; i < count; ++i) body(i);
    return;
  }
  char started, finished;  // only their addresses count
  release_for_sanitizer(&started);
  workers->arena.execute([&] {
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
      acquire_for_sanitizer(&started);
      body(i);
      release_for_sanitizer(&finished);
    });
  });
  acquire_for_sanitizer(&finished);
}

}  // namespace semblance
