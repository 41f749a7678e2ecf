// SPDX-License-Identifier: Apache-2.0
// BMP, uncompressed (BITMAPINFOHEADER and its longer versions): palettes of 1, 4 or 8 bits, 16 and 32 bits with or without masks, 24 bits.
#include <bit>
#include <cstdlib>

#include "device/error.h"
#include "import/bytes.h"
#include "import/image.h"

namespace kuafu {
namespace {

constexpr uint64_t file_header_bytes = 14, mask_offset = file_header_bytes + 40;
constexpr uint32_t uncompressed = 0, masks = 3;

/// One channel of a masked pixel, scaled to 0 ... 255.
uint8_t channel(uint32_t pixel, uint32_t mask) {
  if (mask == 0) return 255;
  const int shift = std::countr_zero(mask);
  return static_cast<uint8_t>(uint64_t{(pixel & mask) >> shift} * 255 / (mask >> shift));
}

class BmpReader {
 public:
  BmpReader(std::span<const uint8_t> bytes, Texture& texture) : bytes_(bytes), texture_(texture) {}

  void read(Budget& budget) {
    const uint32_t header = u32(bytes_, 14);
    if (header < 40) ks::fail(KS_ERROR_FILE, "a BMP with a header of %u bytes is not read", header);
    const auto width = static_cast<int32_t>(u32(bytes_, 18)), height = static_cast<int32_t>(u32(bytes_, 22));
    bits_ = u16(bytes_, 28);
    const uint32_t compression = u32(bytes_, 30);
    const bool known = bits_ == 1 || bits_ == 4 || bits_ == 8 || bits_ == 16 || bits_ == 24 || bits_ == 32;
    const bool masked = compression == masks && (bits_ == 16 || bits_ == 32);
    if (!known || (compression != uncompressed && !masked))
      ks::fail(KS_ERROR_FILE, "a BMP of %u bits with compression %u is not read", bits_, compression);
    if (width <= 0 || height == 0 || height == INT32_MIN) ks::fail(KS_ERROR_FILE, "the BMP says its size is %dx%d", width, height);
    read_masks(masked, header);
    const uint32_t used = u32(bytes_, 46);
    palette_count_ = bits_ > 8 ? 0 : used == 0 || used > 1u << bits_ ? 1u << bits_ : used;
    palette_ = part(bytes_, file_header_bytes + header, 4 * uint64_t{palette_count_});
    const uint64_t row_bytes = (uint64_t(width) * bits_ + 31) / 32 * 4, rows = uint64_t(std::abs(height));
    const std::span<const uint8_t> pixels = part(bytes_, u32(bytes_, 10), row_bytes * rows);
    size_texture(texture_, uint64_t(width), rows, alpha_ != 0 ? 4 : 3, Texture::Format::u8, budget);
    for (uint64_t y = 0; y < rows; ++y) read_row(pixels.subspan(y * row_bytes, row_bytes), height > 0 ? rows - 1 - y : y);
  }

 private:
  void read_masks(bool masked, uint32_t header) {
    for (uint32_t c = 0; c < 3; ++c) {
      rgb_[c] = bits_ == 16 ? 0x7c00u >> (5 * c) : 0xff0000u >> (8 * c);
      if (masked) rgb_[c] = u32(bytes_, mask_offset + 4 * c);
    }
    if (masked && header >= 56) alpha_ = u32(bytes_, mask_offset + 12);
  }

  void read_row(std::span<const uint8_t> row, uint64_t y) {
    for (uint64_t x = 0; x < texture_.width; ++x) {
      uint8_t* to = texture_.texels.data() + (y * texture_.width + x) * texture_.channels;
      if (bits_ <= 8) {
        const uint64_t bit = x * bits_;
        const uint32_t index = u8(row, bit / 8) >> (8 - bits_ - bit % 8) & ((1u << bits_) - 1);
        const auto colour = part(palette_, 4 * uint64_t{index}, 3);
        for (uint32_t c = 0; c < 3; ++c) to[c] = colour[2 - c];
        continue;
      }
      const uint32_t pixel = bits_ == 16   ? u16(row, 2 * x)
                             : bits_ == 32 ? u32(row, 4 * x)
                                           : u8(row, 3 * x) | u8(row, 3 * x + 1) << 8 | u8(row, 3 * x + 2) << 16;
      for (uint32_t c = 0; c < 3; ++c) to[c] = channel(pixel, rgb_[c]);
      if (alpha_ != 0) to[3] = channel(pixel, alpha_);
    }
  }

  std::span<const uint8_t> bytes_, palette_;
  Texture& texture_;
  uint32_t bits_ = 0, palette_count_ = 0, alpha_ = 0;
  uint32_t rgb_[3] = {};
};

}  // namespace

bool is_bmp(std::span<const uint8_t> bytes) { return bytes.size() > 2 && bytes[0] == 'B' && bytes[1] == 'M'; }

void decode_bmp(std::span<const uint8_t> bytes, Texture& texture, Budget& budget) { BmpReader(bytes, texture).read(budget); }

}  // namespace kuafu
