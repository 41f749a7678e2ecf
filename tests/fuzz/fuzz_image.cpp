// SPDX-License-Identifier: Apache-2.0
// Bytes as an image file: a texture of the size it says, or one error.
#include "device/error.h"
#include "import/image.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  kuafu::Budget budget;
  budget.limit_claims(256 << 20);
  try {
    const kuafu::Texture texture = kuafu::decode_image({data, size}, "x", true, budget);
    const size_t channel_bytes = texture.format == kuafu::Texture::Format::u16 ? 2 : 1;
    if (texture.texels.size() != size_t{texture.width} * texture.height * texture.channels * channel_bytes) __builtin_trap();
  } catch (const ks::Error&) {
  }
  return 0;
}
