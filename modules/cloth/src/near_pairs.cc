#include "near_pairs.h"

namespace semblance {

void sort_pairs(std::vector<NearPair>& pairs, int count_of_a, std::vector<NearPair>& scratch,
                std::vector<int>& starts) {
  starts.assign(static_cast<std::size_t>(count_of_a) + 1, 0);
  for (const NearPair& pair : pairs) ++starts[pair.a + 1];
  for (int a = 0; a < count_of_a; ++a) starts[a + 1] += starts[a];
  scratch.resize(pairs.size());
  for (const NearPair& pair : pairs) scratch[starts[pair.a]++] = pair;
  // starts[a] is now where the pairs of a end.
  for (int a = 0, begin = 0; a < count_of_a; begin = starts[a], ++a)
    std::sort(scratch.begin() + begin, scratch.begin() + starts[a],
              [](const NearPair& p, const NearPair& q) { return p.b < q.b; });
  pairs.swap(scratch);
}

}  // namespace semblance
