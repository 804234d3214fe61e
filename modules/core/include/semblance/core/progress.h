// How long work tells where it is, and learns that it should stop.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace semblance {

/// Sink for the progress of one task at a time. All calls come from one thread.
class Progress {
 public:
  virtual ~Progress() = default;
  /// A task of `total` steps starts (0 when the number is unknown).
  virtual void begin(const std::string& task, std::int64_t total) = 0;
  /// `done` steps of the task are finished.
  virtual void update(std::int64_t done) = 0;
  virtual void end() = 0;
  /// True when the caller wants the work to stop at the next safe place and keep what is done.
  virtual bool cancelled() const { return false; }
};

/// Says nothing and never cancels.
Progress& silent_progress();

/// Writes to stderr: one line with rate and time left, rewritten, on a terminal; a plain line every
/// few seconds elsewhere. `cancelled` follows `interrupted()`.
std::unique_ptr<Progress> console_progress();

/// From now on SIGINT and SIGTERM set a flag instead of ending the program; a second one ends it.
void catch_interrupts();
/// True once a caught signal arrived.
bool interrupted();

}  // namespace semblance
