// GLSL's names for C++: include before shaders/lib and shaders/stage, inside namespace kuafu's files only.
#pragma once

#include <glm/glm.hpp>
#include <glm/gtc/packing.hpp>

#include "shared/wave.h"

// The text is written for both languages; what one of them leaves unused or sets in a branch is no mistake.
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"

namespace kuafu {
namespace {
using namespace glm;
using uint = uint32_t;
constexpr uint queue_layout = queue_layout_packets;
}  // namespace
}  // namespace kuafu
