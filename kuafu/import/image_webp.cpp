// SPDX-License-Identifier: Apache-2.0
// WebP by libwebp: lossy and lossless, with and without alpha. Of an animation libwebp reads nothing, which is an error.
#include <webp/decode.h>

#include <cstring>

#include "device/error.h"
#include "import/image.h"

namespace kuafu {

bool is_webp(std::span<const uint8_t> bytes) {
  return bytes.size() >= 12 && std::memcmp(bytes.data(), "RIFF", 4) == 0 && std::memcmp(bytes.data() + 8, "WEBP", 4) == 0;
}

void decode_webp(std::span<const uint8_t> bytes, Texture& texture, Budget& budget) {
  WebPBitstreamFeatures facts{};
  if (WebPGetFeatures(bytes.data(), bytes.size(), &facts) != VP8_STATUS_OK) ks::fail(KS_ERROR_FILE, "the WebP data is broken");
  if (facts.has_animation) ks::fail(KS_ERROR_FILE, "it is an animated WebP, of which no frame is read: save one as an image");
  const uint32_t channels = facts.has_alpha ? 4 : 3;
  size_texture(texture, uint64_t(facts.width), uint64_t(facts.height), channels, Texture::Format::u8, budget);
  const int row_bytes = static_cast<int>(texture.width * channels);
  const auto decode = facts.has_alpha ? WebPDecodeRGBAInto : WebPDecodeRGBInto;
  if (decode(bytes.data(), bytes.size(), texture.texels.data(), texture.texels.size(), row_bytes) == nullptr)
    ks::fail(KS_ERROR_FILE, "the WebP data is broken or ends too early");
}

}  // namespace kuafu
