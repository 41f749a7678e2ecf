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

/// The picture as libpng's callbacks make it. They hold no object with a destructor, for libpng leaves them by longjmp.
struct Output {
  uint8_t* texels = nullptr;
  size_t row_bytes = 0;
  uint32_t rows = 0;
  int last_pass = 0;
  bool has_header = false, is_whole = false;
  size_t left = 0;  // bytes behind what has been taken, where a callback has stopped
  std::array<char, 200> error{};
};

Output& output_of(png_structp png) { return *static_cast<Output*>(png_get_progressive_ptr(png)); }

void keep_error(png_structp png, png_const_charp text) {
  auto* output = static_cast<Output*>(png_get_error_ptr(png));
  std::strncpy(output->error.data(), text, output->error.size() - 1);
  png_longjmp(png, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

void on_header(png_structp png, png_infop info) {
  png_set_expand(png);                                        // palettes, fewer than 8 bits, transparency as a channel
  if (png_get_bit_depth(png, info) == 16) png_set_swap(png);  // little-endian, as in memory
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, info);
  Output& output = output_of(png);
  output.has_header = true;
  output.last_pass = passes - 1;
  output.left = png_process_data_pause(png, 0);
}

/// Ends with the last row: what the data has behind it, perhaps gigabytes once it is inflated, is not looked at.
void on_row(png_structp png, png_bytep row, png_uint_32 number, int pass) {
  Output& output = output_of(png);
  if (row != nullptr) png_progressive_combine_row(png, output.texels + number * output.row_bytes, row);
  if (pass != output.last_pass || number + 1 != output.rows) return;
  output.is_whole = true;
  png_longjmp(png, 1);  // libpng's pause is for headers: within pixels it loses count of its buffer
}

/// Takes data until a callback stops it, or the data ends; false for an error and behind the last row.
bool process(png_structp png, png_infop info, std::span<const uint8_t> bytes) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_process_data(png, info, const_cast<png_bytep>(bytes.data()), bytes.size());
  return true;
}

class PngReader {
 public:
  PngReader() {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &output_, keep_error, ignore_warning);
    info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw std::bad_alloc();
    }
    png_set_progressive_read_fn(png_, &output_, on_header, on_row, nullptr);
    // Descriptions of the picture may have any length; libpng need not keep them.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, 0);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  void read(std::span<const uint8_t> bytes, Texture& texture, Budget& budget) {
    if (!process(png_, info_, bytes) || !output_.has_header) fail();
    const bool deep = png_get_bit_depth(png_, info_) == 16;
    size_texture(texture, png_get_image_width(png_, info_), png_get_image_height(png_, info_), png_get_channels(png_, info_),
                 deep ? Texture::Format::u16 : Texture::Format::u8, budget);
    output_.texels = texture.texels.data();
    output_.row_bytes = png_get_rowbytes(png_, info_);
    output_.rows = texture.height;
    process(png_, info_, bytes.last(output_.left));
    if (!output_.is_whole) fail();
  }

 private:
  [[noreturn]] void fail() const {
    ks::fail(KS_ERROR_FILE, "the PNG data is broken: %s", output_.error[0] != 0 ? output_.error.data() : "the data ends too early");
  }
  Output output_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

}  // namespace

bool is_png(std::span<const uint8_t> bytes) { return bytes.size() > 8 && png_sig_cmp(bytes.data(), 0, 8) == 0; }

void decode_png(std::span<const uint8_t> bytes, Texture& texture, Budget& budget) { PngReader().read(bytes, texture, budget); }

}  // namespace kuafu
