#include "semblance/core/version.h"

namespace semblance {

const char* program_version() { return "semblance " SEMBLANCE_VERSION; }

}  // namespace semblance
