#pragma once

namespace semblance {

/// "semblance 0.1.0"
const char* program_version();

}  // namespace semblance
