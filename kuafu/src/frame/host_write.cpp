// SPDX-License-Identifier: Apache-2.0
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

}  // namespace

void host::write(const WritePush& push, uint32_t first, uint32_t end) {
  for (Write stage{push}; first < end; ++first) stage.write_pixel(first);
}

}  // namespace kuafu
