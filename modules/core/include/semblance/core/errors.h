// The three errors the library throws. Anything else that escapes is a defect.
#pragma once

#include <stdexcept>
#include <string>

namespace semblance {

/// What the caller or a file gave cannot be used. The message names the input (file, and line
/// where there is one), what was expected, and how to mend it. The program exits with 3.
class InvalidInput : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The operating system refused: a file that cannot be opened, a full disk. Exits with 3.
class IoError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A numerical method could not deliver any usable answer. Exits with 4.
class SolverError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace semblance
