// SPDX-License-Identifier: Apache-2.0
// PNG by libpng: 8 or 16 bit per channel, gray, gray and alpha, RGB or RGBA; palettes and fewer bits are expanded.
#include <png.h>

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstring>

#include "device/error.h"
#include "import/image.h"

namespace kuafu {
namespace {

struct Input {
  std::span<const uint8_t> bytes;
  size_t at = 0;
  std::array<char, 200> error{};
};

void read_part(png_structp png, png_bytep to, size_t size) {
  auto* input = static_cast<Input*>(png_get_io_ptr(png));
  if (size > input->bytes.size() - input->at) png_error(png, "the data ends too early");
  std::memcpy(to, input->bytes.data() + input->at, size);
  input->at += size;
}

void keep_error(png_structp png, png_const_charp text) {
  auto* input = static_cast<Input*>(png_get_error_ptr(png));
  std::strncpy(input->error.data(), text, input->error.size() - 1);
  png_longjmp(png, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

// The functions between setjmp and libpng's longjmp hold no object with a destructor.
bool read_header(png_structp png, png_infop info) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_read_info(png, info);
  png_set_expand(png);                                        // palettes, fewer than 8 bits, transparency as a channel
  if (png_get_bit_depth(png, info) == 16) png_set_swap(png);  // little-endian, as in memory
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  return true;
}

bool read_rows(png_structp png, uint8_t* texels, size_t row_bytes, uint32_t rows, int passes) {
  if (setjmp(png_jmpbuf(png))) return false;
  for (int pass = 0; pass < passes; ++pass)
    for (uint32_t row = 0; row < rows; ++row) png_read_row(png, texels + row * row_bytes, nullptr);
  return true;
}

class PngReader {
 public:
  explicit PngReader(std::span<const uint8_t> bytes) : input_{bytes} {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &input_, keep_error, ignore_warning);
    info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw std::bad_alloc();
    }
    png_set_read_fn(png_, &input_, read_part);
    // What describes the picture but is no part of it may be as long as it likes; libpng need not keep it.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, 0);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  void read(Texture& texture, Budget& budget) {
    if (!read_header(png_, info_)) fail();
    const bool deep = png_get_bit_depth(png_, info_) == 16;
    size_texture(texture, png_get_image_width(png_, info_), png_get_image_height(png_, info_), png_get_channels(png_, info_),
                 deep ? Texture::Format::u16 : Texture::Format::u8, budget);
    const int passes = png_get_interlace_type(png_, info_) == PNG_INTERLACE_ADAM7 ? PNG_INTERLACE_ADAM7_PASSES : 1;
    if (!read_rows(png_, texture.texels.data(), png_get_rowbytes(png_, info_), texture.height, passes)) fail();
  }

 private:
  [[noreturn]] void fail() const { ks::fail(KS_ERROR_FILE, "the PNG data is broken: %s", input_.error.data()); }
  Input input_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

}  // namespace

bool is_png(std::span<const uint8_t> bytes) { return bytes.size() > 8 && png_sig_cmp(bytes.data(), 0, 8) == 0; }

void decode_png(std::span<const uint8_t> bytes, Texture& texture, Budget& budget) { PngReader(bytes).read(texture, budget); }

}  // namespace kuafu
