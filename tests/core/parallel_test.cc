#include "semblance/core/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

class Parallel : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override { set_thread_count(GetParam()); }
  void TearDown() override { set_thread_count(0); }
};

TEST_P(Parallel, VisitsEveryIndexOnce) {
  for (const std::size_t count : {0, 1, 2, 1000}) {
    std::vector<std::atomic<int>> visits(count);
    parallel_for(count, [&](std::size_t i) { ++visits[i]; });
    for (const auto& visit : visits) EXPECT_EQ(visit, 1);
  }
}

TEST_P(Parallel, RethrowsAnException) {
  std::vector<std::atomic<int>> visits(100);
  EXPECT_THROW(parallel_for(100,
                            [&](std::size_t i) {
                              if (i == 40) throw InvalidInput("item 40");
                              ++visits[i];
                            }),
               InvalidInput);
  for (const auto& visit : visits) EXPECT_LE(visit, 1);
  EXPECT_EQ(visits[40], 0);
}

TEST_P(Parallel, MayBeNested) {
  std::vector<std::atomic<int>> visits(64);
  parallel_for(
      8, [&](std::size_t i) { parallel_for(8, [&](std::size_t j) { ++visits[8 * i + j]; }); });
  for (const auto& visit : visits) EXPECT_EQ(visit, 1);
}

TEST_P(Parallel, KeepsToTheLimit) {
  std::mutex mutex;
  std::set<std::thread::id> threads;
  parallel_for(200, [&](std::size_t) {
    const std::lock_guard lock(mutex);
    threads.insert(std::this_thread::get_id());
  });
  EXPECT_LE(static_cast<int>(threads.size()), thread_count());
}

INSTANTIATE_TEST_SUITE_P(ThreadCounts, Parallel, ::testing::Values(0, 1, 2, 4));

TEST(ParallelSettings, ThreadCountFollowsTheSetting) {
  set_thread_count(3);
  EXPECT_EQ(thread_count(), 3);
  EXPECT_THROW(set_thread_count(-1), InvalidInput);
  EXPECT_EQ(thread_count(), 3);
  set_thread_count(0);
  EXPECT_GE(thread_count(), 1);
}

}  // namespace
}  // namespace semblance
