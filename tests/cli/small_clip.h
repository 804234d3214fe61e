// One short generated clip for all tests of the program.
#pragma once

#include "semblance/synth/generate.h"

namespace semblance::testing {

constexpr int kSmallClipFrames = 24, kSmallClipWidth = 320, kSmallClipHeight = 240;

/// A talking head of 320 x 240 pixels as a folder of images, with camera and truth. Made by the
/// first process that asks, kept in the build folder, and made again after the tests were rebuilt.
ClipFiles small_clip();

}  // namespace semblance::testing
