// SPDX-License-Identifier: Apache-2.0
// Encoded images into textures, each format by its own file: PNG by libpng, JPEG by libjpeg-turbo, WebP by libwebp, BMP and TGA here.
// Thread rule: pure functions. Every decoder throws KS_ERROR_FILE with the reason, and claims the texels from the budget before it takes
// memory for them.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "import/budget.h"
#include "scene/scene.h"

namespace kuafu {

/// Decodes PNG (8 or 16 bit), JPEG, WebP, BMP or TGA, recognised by content. Throws KS_ERROR_FILE with the texture's name.
Texture decode_image(std::span<const uint8_t> bytes, const std::string& name, bool srgb, Budget& budget);

bool is_png(std::span<const uint8_t> bytes);
bool is_jpeg(std::span<const uint8_t> bytes);
bool is_webp(std::span<const uint8_t> bytes);
bool is_bmp(std::span<const uint8_t> bytes);
bool is_tga(std::span<const uint8_t> bytes);
void decode_png(std::span<const uint8_t> bytes, Texture& texture, Budget& budget);
void decode_jpeg(std::span<const uint8_t> bytes, Texture& texture, Budget& budget);
void decode_webp(std::span<const uint8_t> bytes, Texture& texture, Budget& budget);
void decode_bmp(std::span<const uint8_t> bytes, Texture& texture, Budget& budget);
void decode_tga(std::span<const uint8_t> bytes, Texture& texture, Budget& budget);

/// Sets a texture's size and allocates its texels, all zero. Throws for a side of 0 or above 32768.
void size_texture(Texture& texture, uint64_t width, uint64_t height, uint32_t channels, Texture::Format format, Budget& budget);

}  // namespace kuafu
