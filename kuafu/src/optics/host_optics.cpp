// SPDX-License-Identifier: Apache-2.0
#include "optics/optics.h"

#include "frame/host_language.h"

namespace kuafu {
namespace {

#include "lib/distortion.glsl"

struct OpticsStage {
  const OpticsPush& push;
#include "stage/optics.glsl"
};

}  // namespace

void host::optics(const OpticsPush& push, uint32_t first, uint32_t end) {
  for (OpticsStage stage{push}; first < end; ++first) stage.optics(first);
}

}  // namespace kuafu
