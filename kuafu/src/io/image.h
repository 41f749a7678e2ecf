// Files and encoded images into memory. Thread rule: pure functions.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace kuafu {

/// Throws KS_ERROR_FILE when the file is missing, empty or unreadable.
std::vector<uint8_t> read_bytes(const std::filesystem::path& path);

/// PNG (8 or 16 bit), JPEG, BMP or TGA, told by content. Throws KS_ERROR_FILE that names the texture.
Texture decode_image(std::span<const uint8_t> bytes, const std::string& name, bool srgb);

}  // namespace kuafu
