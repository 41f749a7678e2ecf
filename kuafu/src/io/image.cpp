#include "io/image.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>

#include "device/error.h"

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_ONLY_BMP
#define STBI_ONLY_TGA
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS (1 << 15)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop

namespace kuafu {

std::vector<uint8_t> read_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) ks::fail(KS_ERROR_FILE, "cannot open '%s': %s", path.c_str(), std::strerror(errno));
  const std::streamoff size = file.tellg();
  if (size <= 0) ks::fail(KS_ERROR_FILE, "'%s' is empty or cannot be read", path.c_str());
  std::vector<uint8_t> bytes(static_cast<size_t>(size));
  file.seekg(0);
  if (!file.read(reinterpret_cast<char*>(bytes.data()), size))
    ks::fail(KS_ERROR_FILE, "cannot read the %lld bytes of '%s'", static_cast<long long>(size), path.c_str());
  return bytes;
}

Texture decode_image(std::span<const uint8_t> bytes, const std::string& name, bool srgb) {
  if (bytes.empty() || bytes.size() > 0x7fffffffu)
    ks::fail(KS_ERROR_FILE, "texture '%s': an encoded image of %zu bytes, must be 1 to 2^31 - 1", name.c_str(), bytes.size());
  const int size = static_cast<int>(bytes.size());
  const bool deep = stbi_is_16_bit_from_memory(bytes.data(), size) != 0;
  int width = 0, height = 0, channels = 0;
  void* data = deep ? static_cast<void*>(stbi_load_16_from_memory(bytes.data(), size, &width, &height, &channels, 0))
                    : static_cast<void*>(stbi_load_from_memory(bytes.data(), size, &width, &height, &channels, 0));
  const std::unique_ptr<void, void (*)(void*)> owner(data, stbi_image_free);
  if (data == nullptr)
    ks::fail(KS_ERROR_FILE, "texture '%s' is not a PNG, JPEG, BMP or TGA image that can be read: %s", name.c_str(), stbi_failure_reason());
  Texture texture;
  texture.name = name;
  texture.width = static_cast<uint32_t>(width);
  texture.height = static_cast<uint32_t>(height);
  texture.channels = static_cast<uint32_t>(channels);
  texture.format = deep ? Texture::Format::u16 : Texture::Format::u8;
  texture.srgb = srgb;
  const auto* first = static_cast<const uint8_t*>(data);
  texture.texels.assign(first, first + size_t{texture.width} * texture.height * texture.channels * (deep ? 2 : 1));
  return texture;
}

}  // namespace kuafu
