#include "semblance/core/parallel.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <memory>
#include <mutex>
#include <string>

#include "semblance/core/errors.h"

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
  workers->arena.execute([&] { tbb::parallel_for(std::size_t{0}, count, body); });
}

}  // namespace semblance
