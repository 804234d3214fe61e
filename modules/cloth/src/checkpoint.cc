#include "semblance/cloth/checkpoint.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <type_traits>

#include "byte_sum.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

static_assert(std::endian::native == std::endian::little,
              "checkpoints are written as the numbers lie in memory");

constexpr std::string_view magic = "semblance.cloth_checkpoint/2\n";
constexpr std::uintmax_t largest_file_bytes = std::uintmax_t{8} << 30;

/// Both directions visit the same fields in the same order (see `visit`).
class Writer {
 public:
  template <class T>
  void number(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    out_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void flag(const bool& value) { number(static_cast<std::uint8_t>(value)); }
  void text(const std::string& value) {
    number(static_cast<std::uint64_t>(value.size()));
    out_ += value;
  }
  void numbers(const std::vector<double>& values) {
    number(static_cast<std::uint64_t>(values.size()));
    append(values.data(), values.size());
  }
  void points(const Points& values) {
    number(static_cast<std::uint64_t>(values.rows()));
    append(values.data(), static_cast<std::size_t>(values.size()));
  }
  void maybe(const std::optional<double>& value) {
    flag(value.has_value());
    number(value.value_or(0.0));
  }
  /// In the order of keys: a map's own order is not always the same.
  void friction(const FrictionMemory& memory) {
    std::vector<std::uint64_t> keys;
    for (const auto& [key, unused] : memory) keys.push_back(key);
    std::sort(keys.begin(), keys.end());
    number(static_cast<std::uint64_t>(keys.size()));
    for (const std::uint64_t key : keys) {
      number(key);
      append(memory.at(key).data(), 3);
    }
  }
  template <class T, class Body>
  void list(const std::vector<T>& values, const Body& body) {
    number(static_cast<std::uint64_t>(values.size()));
    for (const T& value : values) body(*this, value);
  }
  std::string take() { return std::move(out_); }

 private:
  void append(const double* values, std::size_t count) {
    out_.append(reinterpret_cast<const char*>(values), count * sizeof(double));
  }
  std::string out_;
};

class Reader {
 public:
  Reader(std::string_view bytes, const std::string& source) : rest_(bytes), source_(source) {}

  template <class T>
  void number(T& value) {
    copy(&value, sizeof value);
  }
  void flag(bool& value) {
    std::uint8_t byte = 0;
    number(byte);
    if (byte > 1) fail("a flag is neither 0 nor 1");
    value = byte == 1;
  }
  void text(std::string& value) {
    value.resize(count(1));
    copy(value.data(), value.size());
  }
  void numbers(std::vector<double>& values) {
    values.resize(count(sizeof(double)));
    copy(values.data(), values.size() * sizeof(double));
  }
  void points(Points& values) {
    values.resize(static_cast<Eigen::Index>(count(3 * sizeof(double))), 3);
    copy(values.data(), static_cast<std::size_t>(values.size()) * sizeof(double));
    if (!values.allFinite()) fail("a position or velocity is not finite");
  }
  void maybe(std::optional<double>& value) {
    bool there = false;
    double number_read = 0.0;
    flag(there);
    number(number_read);
    if (there) value = number_read;
  }
  void friction(FrictionMemory& memory) {
    const std::size_t size = count(sizeof(std::uint64_t) + 3 * sizeof(double));
    memory.reserve(size);
    for (std::size_t k = 0; k < size; ++k) {
      std::uint64_t key = 0;
      number(key);
      copy(memory[key].data(), 3 * sizeof(double));
    }
  }
  template <class T, class Body>
  void list(std::vector<T>& values, const Body& body) {
    const std::size_t size = count(1);
    values.clear();
    for (std::size_t k = 0; k < size; ++k) body(*this, values.emplace_back());
  }
  void finish() const {
    if (!rest_.empty()) fail("there is more than a checkpoint in it");
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InvalidInput(source_ + ": this checkpoint cannot be used: " + what +
                       "; remove it to start anew");
  }
  /// A count of entries of that size, as far as the file can hold them.
  std::size_t count(std::size_t entry_bytes) {
    std::uint64_t value = 0;
    number(value);
    if (value > rest_.size() / entry_bytes) fail("it ends too early");
    return static_cast<std::size_t>(value);
  }
  void copy(void* to, std::size_t bytes) {
    if (bytes > rest_.size()) fail("it ends too early");
    if (bytes > 0) std::memcpy(to, rest_.data(), bytes);
    rest_.remove_prefix(bytes);
  }

  std::string_view rest_;
  const std::string& source_;
};

template <class Archive, class State>
void visit_state(Archive& archive, State& state) {
  archive.number(state.time_s);
  archive.points(state.positions_m);
  archive.points(state.velocities_m_s);
  archive.points(state.previous_positions_m);
  archive.points(state.previous_velocities_m_s);
  archive.number(state.previous_step_s);
  archive.numbers(state.memory.anchor);
  archive.numbers(state.memory.previous);
  archive.friction(state.friction);
}

template <class Archive, class Level>
void visit_level(Archive& archive, Level& level) {
  archive.number(level.spacing_m);
  archive.number(level.vertices);
  archive.number(level.steps);
  archive.number(level.newton_iterations);
  archive.number(level.linear_iterations);
  archive.number(level.residual);
  archive.flag(level.at_rest);
  archive.number(level.cpu_s);
  archive.number(level.wall_s);
  archive.number(level.contact_s);
  archive.text(level.start);
}

template <class Archive, class Row>
void visit_row(Archive& archive, Row& row) {
  for (auto* value : {&row.time_s, &row.step_s, &row.kinetic_j, &row.elastic_j, &row.gravity_j,
                      &row.contact_j, &row.speed_m_s, &row.elongation}) {
    archive.number(*value);
  }
  archive.maybe(row.residual);
  for (auto* value : {&row.newton_iterations, &row.linear_iterations, &row.level, &row.contacts}) {
    archive.number(*value);
  }
}

template <class Archive, class Checkpoint>
void visit(Archive& archive, Checkpoint& checkpoint) {
  archive.number(checkpoint.key);
  visit_state(archive, checkpoint.state);
  archive.number(checkpoint.pace.step_s);
  archive.number(checkpoint.pace.tolerance);
  archive.number(checkpoint.easy_steps);
  archive.number(checkpoint.frames);
  archive.number(checkpoint.rejected_steps);
  archive.number(checkpoint.shortest_step_s);
  archive.number(checkpoint.barrier_factor);
  archive.maybe(checkpoint.over_strained_s);
  archive.list(checkpoint.levels, [](auto& inner, auto& level) { visit_level(inner, level); });
  archive.list(checkpoint.rows, [](auto& inner, auto& row) { visit_row(inner, row); });
}

}  // namespace

std::string format_checkpoint(const SimulationCheckpoint& checkpoint) {
  Writer writer;
  visit(writer, checkpoint);
  std::string bytes = std::string(magic) + writer.take();
  const std::uint64_t sum = byte_sum(bytes);
  bytes.append(reinterpret_cast<const char*>(&sum), sizeof sum);
  return bytes;
}

SimulationCheckpoint parse_checkpoint(std::string_view bytes, const std::string& source) {
  if (!bytes.starts_with(magic)) {
    throw InvalidInput(source + ": is no checkpoint of this version; remove it to start anew");
  }
  std::uint64_t sum = 0;
  if (bytes.size() < magic.size() + sizeof sum) {
    throw InvalidInput(source + ": this checkpoint ends too early; remove it to start anew");
  }
  std::memcpy(&sum, bytes.data() + bytes.size() - sizeof sum, sizeof sum);
  bytes.remove_suffix(sizeof sum);
  if (sum != byte_sum(bytes)) {
    throw InvalidInput(source + ": this checkpoint is damaged; remove it to start anew");
  }
  Reader reader(bytes.substr(magic.size()), source);
  SimulationCheckpoint checkpoint;
  visit(reader, checkpoint);
  reader.finish();
  return checkpoint;
}

void write_checkpoint(const std::string& path, const SimulationCheckpoint& checkpoint) {
  AtomicFile file(path);
  const std::string bytes = format_checkpoint(checkpoint);
  file.stream().write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.commit();
}

SimulationCheckpoint read_checkpoint(const std::string& path) {
  return parse_checkpoint(text::read_file(path, largest_file_bytes), path);
}

}  // namespace semblance
