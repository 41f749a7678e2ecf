// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>

#include "frame/frame.h"
#include "frame/host_language.h"

namespace kuafu {
namespace {

#include "lib/element.glsl"
#include "lib/pixels.glsl"

struct Write {
  const WritePush& push;
#include "stage/write.glsl"
};

/// Part of a row of floats, whose place takes divisions for all of it.
void write_floats(const WritePush& push, uint32_t first, uint32_t end) {
  const uint32_t row = first / push.width, count = (end - first) * push.channels;
  const Pixel pixel{row / push.height, row % push.height, first - row * push.width};
  uint32_t* to = push.to.words.at + output_element(push.to, pixel, push.channels);
  const uint32_t* from = push.from.at + uint64_t(first) * push.channels;
  const float scale = push.to.scale;
  if (push.sums == 0) {
    for (uint32_t k = 0; k < count; ++k) to[k] = std::bit_cast<uint32_t>(std::bit_cast<float>(from[k]) * scale);
    return;
  }
  const float* second = push.second.at + uint64_t(first) * push.channels;
  for (uint32_t k = 0; k < count; ++k) to[k] = std::bit_cast<uint32_t>((std::bit_cast<float>(from[k]) + second[k]) * scale);
}

}  // namespace

void host::write(const WritePush& push, uint32_t first, uint32_t end) {
  if (push.to.format != format_f32 || push.integer != 0) {
    for (Write stage{push}; first < end; ++first) stage.write_pixel(first);
    return;
  }
  for (uint32_t next = first; next < end; first = next) {
    next = std::min(end, (first / push.width + 1) * push.width);
    write_floats(push, first, next);
  }
}

}  // namespace kuafu
