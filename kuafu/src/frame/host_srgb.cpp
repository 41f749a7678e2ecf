// SPDX-License-Identifier: Apache-2.0
#include "frame/host_language.h"
#include "frame/srgb.h"

namespace kuafu {
namespace {

#include "lib/pixels.glsl"

struct Srgb {
  const SrgbPush& push;
#include "stage/srgb.glsl"
};

}  // namespace

void host::srgb(const SrgbPush& push, uint32_t first, uint32_t end) {
  for (Srgb stage{push}; first < end; ++first) stage.srgb(first);
}

}  // namespace kuafu
