// SPDX-License-Identifier: Apache-2.0
#include "import/image.h"

#include <algorithm>
#include <string_view>

#include "device/error.h"
#include "scene/validate.h"

namespace kuafu {
namespace {

using Decoder = void (*)(std::span<const uint8_t>, Texture&, Budget&);

/// TGA has no signature, so it comes last.
Decoder decoder_of(std::span<const uint8_t> bytes) {
  if (is_png(bytes)) return decode_png;
  if (is_jpeg(bytes)) return decode_jpeg;
  if (is_webp(bytes)) return decode_webp;
  if (is_bmp(bytes)) return decode_bmp;
  if (is_tga(bytes)) return decode_tga;
  return nullptr;
}

/// The name of a format that is known and not read; nullptr: none of those.
const char* unread_format(std::span<const uint8_t> bytes) {
  static constexpr std::pair<std::string_view, const char*> first_bytes[] = {
      {"\xabKTX ", "KTX"}, {"DDS ", "DDS"}, {"II*", "TIFF"}, {{"MM\0*", 4}, "TIFF"}, {"GIF8", "GIF"}, {"8BPS", "Photoshop"},
  };
  const std::string_view file(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (const auto& [first, format] : first_bytes)
    if (file.starts_with(first)) return format;
  return nullptr;
}

}  // namespace

void size_texture(Texture& texture, uint64_t width, uint64_t height, uint32_t channels, Texture::Format format, Budget& budget) {
  texture.width = static_cast<uint32_t>(std::min<uint64_t>(width, none));
  texture.height = static_cast<uint32_t>(std::min<uint64_t>(height, none));
  texture.channels = channels;
  texture.format = format;
  const uint64_t bytes = texel_bytes(texture);
  budget.claim(bytes, "an image of " + std::to_string(width) + "x" + std::to_string(height) + " pixels");
  texture.texels.assign(bytes, 0);
}

Texture decode_image(std::span<const uint8_t> bytes, const std::string& name, bool srgb, Budget& budget) {
  const Decoder decode = decoder_of(bytes);
  const char* unread = unread_format(bytes);
  if (unread != nullptr)
    ks::fail(KS_ERROR_UNSUPPORTED, "texture '%s' is a %s file, which is not read: export it as PNG, JPEG or WebP", name.c_str(), unread);
  if (decode == nullptr)
    ks::fail(KS_ERROR_FILE, "texture '%s' is not a PNG, JPEG, WebP, BMP or TGA image that can be read: its first bytes are of none of them",
             name.c_str());
  Texture texture;
  texture.name = name;
  texture.srgb = srgb;
  try {
    decode(bytes, texture, budget);
  } catch (const ks::Error& error) {
    ks::fail(KS_ERROR_FILE, "texture '%s' cannot be read: %s", name.c_str(), error.what());
  }
  return texture;
}

}  // namespace kuafu
