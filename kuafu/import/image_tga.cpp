// SPDX-License-Identifier: Apache-2.0
// TGA (Truevision, TGA 2.0 specification, 1991): gray, colour of 15, 16, 24 or 32 bits, and colour maps; plain or run-length coded.
#include "device/error.h"
#include "import/bytes.h"
#include "import/image.h"

namespace kuafu {
namespace {

constexpr uint64_t header_bytes = 18;

struct Header {
  uint32_t id_bytes = 0, type = 0, map_first = 0, map_count = 0, map_bits = 0, width = 0, height = 0, bits = 0;
  bool runs = false, top_down = false, right_to_left = false;
};

Header read_header(std::span<const uint8_t> b) {
  const uint32_t type = u8(b, 2), descriptor = u8(b, 17);
  return {.id_bytes = u8(b, 0),
          .type = type & 7u,
          .map_first = u16(b, 3),
          .map_count = u16(b, 5),
          .map_bits = u8(b, 7),
          .width = u16(b, 12),
          .height = u16(b, 14),
          .bits = u8(b, 16),
          .runs = (type & 8u) != 0,
          .top_down = (descriptor & 0x20u) != 0,
          .right_to_left = (descriptor & 0x10u) != 0};
}

bool is_colour(uint32_t bits) { return bits == 15 || bits == 16 || bits == 24 || bits == 32; }

/// Files have B G R A, or 5 bits of each in a word; texels R G B A.
void put_colour(std::span<const uint8_t> from, uint8_t* to) {
  if (from.size() == 2) {
    const uint32_t word = from[0] | uint32_t{from[1]} << 8;
    for (uint32_t c = 0; c < 3; ++c) to[c] = static_cast<uint8_t>((word >> (10 - 5 * c) & 31u) * 255 / 31);
    return;
  }
  to[0] = from[2], to[1] = from[1], to[2] = from[0];
  if (from.size() == 4) to[3] = from[3];
}

class TgaReader {
 public:
  TgaReader(std::span<const uint8_t> bytes, Texture& texture) : bytes_(bytes), texture_(texture), h_(read_header(bytes)) {}

  void read(Budget& budget) {
    const bool gray = h_.type == 3, mapped = h_.type == 1;
    const uint32_t colour_bits = mapped ? h_.map_bits : h_.bits;
    if ((gray || mapped) ? h_.bits != 8 : h_.type != 2)
      ks::fail(KS_ERROR_FILE, "a TGA of type %u with %u bits is not read", h_.type, h_.bits);
    if (!gray && !is_colour(colour_bits)) ks::fail(KS_ERROR_FILE, "a TGA with colours of %u bits is not read", colour_bits);
    colour_bytes_ = (colour_bits + 7) / 8;
    const uint64_t map_bytes = u8(bytes_, 1) != 0 ? uint64_t{h_.map_count} * ((h_.map_bits + 7) / 8) : 0;
    if (mapped) map_ = part(bytes_, header_bytes + h_.id_bytes, map_bytes);
    at_ = header_bytes + h_.id_bytes + map_bytes;
    check_length();
    size_texture(texture_, h_.width, h_.height, gray ? 1 : colour_bits == 32 ? 4 : 3, Texture::Format::u8, budget);
    for (uint64_t done = 0, count = uint64_t{h_.width} * h_.height; done < count;) done += read_packet(done, count - done);
  }

 private:
  [[nodiscard]] uint32_t pixel_bytes() const { return (h_.bits + 7) / 8; }

  /// A plain file has a byte for each; a packet of runs stands for at most 128 pixels.
  void check_length() const {
    const uint64_t pixels = uint64_t{h_.width} * h_.height;
    const uint64_t needed = h_.runs ? (pixels + 127) / 128 * (1 + pixel_bytes()) : pixels * pixel_bytes();
    if (needed > bytes_.size() - std::min<uint64_t>(at_, bytes_.size()))
      ks::fail(KS_ERROR_FILE, "a TGA of %ux%u pixels needs %llu bytes or more after its header, the data ends too early", h_.width,
               h_.height, static_cast<unsigned long long>(needed));
  }

  /// Returns how many pixels it brought.
  uint64_t read_packet(uint64_t first, uint64_t most) {
    uint64_t count = most;
    bool repeat = false;
    if (h_.runs) {
      const uint32_t head = u8(bytes_, at_++);
      repeat = (head & 0x80u) != 0;
      count = std::min<uint64_t>((head & 0x7fu) + 1, most);
    }
    for (uint64_t i = 0; i < count; ++i) {
      put(first + i, part(bytes_, at_, pixel_bytes()));
      if (!repeat) at_ += pixel_bytes();
    }
    if (repeat) at_ += pixel_bytes();
    return count;
  }

  void put(uint64_t index, std::span<const uint8_t> pixel) {
    uint64_t x = index % h_.width, y = index / h_.width;
    if (h_.right_to_left) x = h_.width - 1 - x;
    if (!h_.top_down) y = h_.height - 1 - y;
    uint8_t* to = texture_.texels.data() + (y * h_.width + x) * texture_.channels;
    if (h_.type == 3) {
      *to = pixel[0];
    } else if (h_.type == 1) {
      if (pixel[0] < h_.map_first) ks::fail(KS_ERROR_FILE, "a pixel has colour %u, the map begins at %u", pixel[0], h_.map_first);
      put_colour(part(map_, uint64_t{pixel[0] - h_.map_first} * colour_bytes_, colour_bytes_), to);
    } else {
      put_colour(pixel, to);
    }
  }

  std::span<const uint8_t> bytes_, map_;
  Texture& texture_;
  const Header h_;
  uint64_t at_ = 0;
  uint32_t colour_bytes_ = 0;
};

}  // namespace

bool is_tga(std::span<const uint8_t> bytes) {
  if (bytes.size() < header_bytes || u8(bytes, 1) > 1) return false;
  const uint32_t type = u8(bytes, 2);
  return (type & ~8u) >= 1 && (type & ~8u) <= 3 && u16(bytes, 12) > 0 && u16(bytes, 14) > 0;
}

void decode_tga(std::span<const uint8_t> bytes, Texture& texture, Budget& budget) { TgaReader(bytes, texture).read(budget); }

}  // namespace kuafu
