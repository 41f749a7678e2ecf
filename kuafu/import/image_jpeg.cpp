// SPDX-License-Identifier: Apache-2.0
// JPEG by libjpeg-turbo: gray, colour, and the inverted CMYK that Adobe's programs write.
#include <cstdio>

#include <jpeglib.h>

#include <array>
#include <csetjmp>

#include "device/error.h"
#include "import/image.h"

namespace kuafu {
namespace {

struct ErrorKeeper {
  jpeg_error_mgr manager;  // first: libjpeg knows a pointer to it
  std::jmp_buf back;
  std::array<char, JMSG_LENGTH_MAX> text;
};

void keep_error(j_common_ptr jpeg) {
  auto* keeper = reinterpret_cast<ErrorKeeper*>(jpeg->err);
  jpeg->err->format_message(jpeg, keeper->text.data());
  std::longjmp(keeper->back, 1);
}

void ignore_message(j_common_ptr, int) {}

// The functions between setjmp and libjpeg's longjmp hold no object with a destructor.
bool read_header(jpeg_decompress_struct& jpeg, ErrorKeeper& keeper, std::span<const uint8_t> bytes) {
  if (setjmp(keeper.back)) return false;
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, bytes.data(), bytes.size());
  jpeg_read_header(&jpeg, TRUE);
  const bool four = jpeg.jpeg_color_space == JCS_CMYK || jpeg.jpeg_color_space == JCS_YCCK;
  jpeg.out_color_space = four ? JCS_CMYK : jpeg.jpeg_color_space == JCS_GRAYSCALE ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_calc_output_dimensions(&jpeg);
  return true;
}

bool read_rows(jpeg_decompress_struct& jpeg, ErrorKeeper& keeper, uint8_t* row_of_four, uint8_t* texels, size_t row_bytes) {
  if (setjmp(keeper.back)) return false;
  jpeg_start_decompress(&jpeg);
  while (jpeg.output_scanline < jpeg.output_height) {
    uint8_t* const to = texels + jpeg.output_scanline * row_bytes;
    JSAMPROW row = row_of_four == nullptr ? to : row_of_four;
    if (jpeg_read_scanlines(&jpeg, &row, 1) != 1) return false;
    for (size_t x = 0; row_of_four != nullptr && x < jpeg.output_width; ++x)
      for (size_t c = 0; c < 3; ++c) to[3 * x + c] = static_cast<uint8_t>(row_of_four[4 * x + c] * row_of_four[4 * x + 3] / 255);
  }
  return true;
}

class JpegReader {
 public:
  JpegReader() {
    jpeg_.err = jpeg_std_error(&keeper_.manager);
    keeper_.manager.error_exit = keep_error;
    keeper_.manager.emit_message = ignore_message;
  }
  ~JpegReader() { jpeg_destroy_decompress(&jpeg_); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  void read(std::span<const uint8_t> bytes, Texture& texture, Budget& budget) {
    if (!read_header(jpeg_, keeper_, bytes)) fail();
    const bool four = jpeg_.out_color_space == JCS_CMYK;
    const uint32_t channels = jpeg_.out_color_space == JCS_GRAYSCALE ? 1 : 3;
    size_texture(texture, jpeg_.output_width, jpeg_.output_height, channels, Texture::Format::u8, budget);
    std::vector<uint8_t> row(four ? size_t{4} * texture.width : 0);
    if (!read_rows(jpeg_, keeper_, four ? row.data() : nullptr, texture.texels.data(), size_t{channels} * texture.width)) fail();
  }

 private:
  [[noreturn]] void fail() const { ks::fail(KS_ERROR_FILE, "the JPEG data is broken: %s", keeper_.text.data()); }
  ErrorKeeper keeper_{};
  jpeg_decompress_struct jpeg_{};
};

}  // namespace

bool is_jpeg(std::span<const uint8_t> bytes) { return bytes.size() > 3 && bytes[0] == 0xff && bytes[1] == 0xd8 && bytes[2] == 0xff; }

void decode_jpeg(std::span<const uint8_t> bytes, Texture& texture, Budget& budget) { JpegReader().read(bytes, texture, budget); }

}  // namespace kuafu
