// Checkpoints as bytes.
#include "semblance/cloth/checkpoint.h"

#include <gmock/gmock.h>

#include "semblance/core/errors.h"

namespace semblance::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

SimulationCheckpoint some_checkpoint() {
  SimulationCheckpoint out;
  out.key = 0x0123456789abcdefull;
  out.state.time_s = 0.25;
  out.state.positions_m = Points::Random(5, 3);
  out.state.velocities_m_s = Points::Random(5, 3);
  out.state.memory = {{1.0, 2.0}, {3.0, 4.0}};
  for (std::uint64_t k = 0; k < 100; ++k) {
    out.state.friction[k * 7919] = Eigen::Vector3d::Constant(1e-6 * static_cast<double>(k));
  }
  out.pace = {0.005, 1e-3};
  out.frames = 7;
  out.over_strained_s = 0.125;
  out.levels = {{.spacing_m = 0.02, .vertices = 5, .steps = 3, .start = "here"}};
  out.rows.resize(3);
  out.rows[2].elastic_j = 0.5;
  out.rows[2].contacts = 12;
  return out;
}

TEST(Checkpoint, ComesBackWhole) {
  const SimulationCheckpoint there = some_checkpoint();
  const std::string bytes = format_checkpoint(there);
  const SimulationCheckpoint back = parse_checkpoint(bytes, "test");
  EXPECT_EQ(back.state.positions_m, there.state.positions_m);
  EXPECT_EQ(back.state.friction, there.state.friction);
  EXPECT_EQ(back.state.previous_positions_m.rows(), 0);
  EXPECT_EQ(back.over_strained_s, there.over_strained_s);
  EXPECT_EQ(back.levels[0].start, "here");
  EXPECT_EQ(format_checkpoint(back), bytes);
}

TEST(Checkpoint, RefusesEveryCut) {
  const std::string bytes = format_checkpoint(some_checkpoint());
  for (std::size_t size = 0; size < bytes.size(); size += 13) {
    EXPECT_THROW(parse_checkpoint(bytes.substr(0, size), "test"), InvalidInput) << size;
  }
  EXPECT_THROW(parse_checkpoint(bytes + "x", "test"), InvalidInput);
}

TEST(Checkpoint, RefusesAChangedByte) {
  std::string bytes = format_checkpoint(some_checkpoint());
  bytes[200] ^= 4;
  EXPECT_THAT(
      [&] { parse_checkpoint(bytes, "run/checkpoint.bin"); },
      ThrowsMessage<InvalidInput>(HasSubstr("run/checkpoint.bin: this checkpoint is damaged")));
}

TEST(Checkpoint, RefusesPositionsThatAreNotFinite) {
  SimulationCheckpoint bad = some_checkpoint();
  bad.state.positions_m(2, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT([&] { parse_checkpoint(format_checkpoint(bad), "test"); },
              ThrowsMessage<InvalidInput>(HasSubstr("not finite")));
}

}  // namespace
}  // namespace semblance::testing
