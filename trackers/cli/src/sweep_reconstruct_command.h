// `semblance sweep scan` and `semblance sweep reconstruct`.
#pragma once

#include "commands.h"

namespace semblance::cli {

void add_sweep_reconstruct_command(CLI::App& sweep, Context& context);

}  // namespace semblance::cli
