// The one way to use several threads.
#pragma once

#include <cstddef>
#include <functional>

namespace semblance {

/// Upper limit on the threads parallel_for uses; 0 restores the number of cores.
void set_thread_count(int count);
int thread_count();

/// Calls body(i) for 0 <= i < count, in any order and on several threads. The first exception is
/// rethrown here. Results must not depend on the order: write to slot i, reduce afterwards.
void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body);

}  // namespace semblance
