// SPDX-License-Identifier: Apache-2.0
// GLSL's names for C++: include before shaders/lib and shaders/stage, inside namespace kuafu's files only.
#pragma once

#include <atomic>
#include <glm/glm.hpp>
#include <glm/gtc/packing.hpp>

#include "shared/wave.h"

// The text is written for two languages, so a function that one of them leaves unused, or a value that it sets in a branch, is no mistake.
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"

namespace kuafu {
namespace {
using namespace glm;
using uint = uint32_t;
constexpr uint queue_layout = queue_layout_packets;

// Counts of several workers.
inline uint atomicAdd(uint& word, uint more) { return std::atomic_ref<uint>(word).fetch_add(more, std::memory_order_relaxed); }
inline uint atomicOr(uint& word, uint bits) { return std::atomic_ref<uint>(word).fetch_or(bits, std::memory_order_relaxed); }

// This is a byte swap and three exchanges, where glm's generic function takes far more.
inline uint bitfieldReverse(uint x) {
  x = __builtin_bswap32(x);
  x = (x >> 4 & 0x0f0f0f0fu) | (x & 0x0f0f0f0fu) << 4;
  x = (x >> 2 & 0x33333333u) | (x & 0x33333333u) << 2;
  return (x >> 1 & 0x55555555u) | (x & 0x55555555u) << 1;
}
}  // namespace
}  // namespace kuafu
