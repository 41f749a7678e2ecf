// SPDX-License-Identifier: Apache-2.0
// Image files of a known picture, and broken ones kept from fuzzing (tests/fuzz/corpus/image), through the decoders in this process.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "capi/device/expect_error.h"
#include "device/error.h"
#include "import/image.h"

namespace {

using namespace kuafu;

const std::filesystem::path here = std::filesystem::path(KUAFU_TESTS) / "kuafu/io";

std::vector<uint8_t> bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

Texture decode(const std::vector<uint8_t>& bytes) {
  Budget budget;
  return decode_image(bytes, "x", false, budget);
}

Texture decode_file(const std::string& name) { return decode(bytes_of(here / "images" / name)); }

/// The picture is 4 x 3 pixels with r = 60 x, g = 100 y, b = 7.
void expect_colours(const Texture& t, uint32_t channels) {
  ASSERT_EQ(t.width, 4u);
  ASSERT_EQ(t.height, 3u);
  ASSERT_EQ(t.channels, channels);
  for (uint32_t y = 0; y < 3; ++y)
    for (uint32_t x = 0; x < 4; ++x) {
      const uint8_t* texel = t.texels.data() + (y * 4 + x) * channels;
      EXPECT_EQ(texel[0], 60 * x);
      EXPECT_EQ(texel[1], 100 * y);
      EXPECT_EQ(texel[2], 7);
      if (channels == 4) {
        EXPECT_EQ(texel[3], 128);
      }
    }
}

TEST(ImageFile, EveryKindOfLosslessFileGivesTheSamePicture) {
  for (const char* name : {"rgb.png", "rgb.bmp", "rgb.tga", "rgb_runs.tga", "palette.png", "palette.bmp", "palette.tga", "rgb.webp"}) {
    SCOPED_TRACE(name);
    expect_colours(decode_file(name), 3);
  }
  for (const char* name : {"rgba.png", "rgba.tga", "rgba.webp"}) {
    SCOPED_TRACE(name);
    expect_colours(decode_file(name), 4);
  }
}

TEST(ImageFile, GrayIsOneChannelAndSixteenBitsStay) {
  for (const char* name : {"gray.png", "gray.tga"}) {
    const Texture t = decode_file(name);
    ASSERT_EQ(t.channels, 1u) << name;
    for (uint8_t i = 0; i < 12; ++i) EXPECT_EQ(t.texels[i], 20 * i) << name;
  }
  const Texture deep = decode_file("gray16.png");
  ASSERT_EQ(deep.format, Texture::Format::u16);
  for (size_t i = 0; i < 12; ++i) EXPECT_EQ(deep.texels[2 * i] | deep.texels[2 * i + 1] << 8, 5000 * int(i) + 3);
}

TEST(ImageFile, JpegColoursAreNear) {
  for (const char* name : {"flat.jpg", "flat_progressive.jpg", "flat_cmyk.jpg", "flat.webp"}) {
    const Texture t = decode_file(name);
    ASSERT_EQ(t.channels, 3u) << name;
    ASSERT_EQ(t.width, 16u);
    for (size_t i = 0; i < t.texels.size(); ++i)
      EXPECT_NEAR(t.texels[i], (i % 3 == 0 ? 200 : i % 3 == 1 ? 100 : 50), 3) << name << " " << i;
  }
  EXPECT_EQ(decode_file("flat_gray.jpg").channels, 1u);
}

TEST(ImageFile, AKtxFileIsNamedAndWhatToDo) {
  EXPECT_ERROR(decode({0xab, 'K', 'T', 'X', ' ', '2', '0', 0xbb, 13, 10, 26, 10}), KS_ERROR_UNSUPPORTED,
               "texture 'x' is a KTX file, which is not read: export it as PNG, JPEG or WebP");
}

TEST(ImageFile, EveryTruncationIsAnErrorOrAPicture) {
  for (const auto& entry : std::filesystem::directory_iterator(here / "images")) {
    const std::vector<uint8_t> whole = bytes_of(entry.path());
    for (size_t size = 0; size < whole.size(); ++size) {
      try {
        const Texture t = decode({whole.begin(), whole.begin() + static_cast<long>(size)});
        EXPECT_EQ(t.texels.size(), size_t{t.width} * t.height * t.channels * (t.format == Texture::Format::u16 ? 2 : 1));
      } catch (const ks::Error& error) {
        EXPECT_NE(std::string(error.what()).find("texture 'x'"), std::string::npos) << error.what();
      }
    }
  }
}

TEST(ImageFile, FilesThatOnceBrokeADecoderAreErrorsOrPictures) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(here / "../../fuzz/corpus/image")) {
    try {
      decode(bytes_of(entry.path()));
    } catch (const ks::Error&) {
    }
    ++count;
  }
  EXPECT_GE(count, 9);
}

TEST(ImageFile, ASizeBeyondTheBudgetOrTheFileIsRefusedBeforeMemoryIsTaken) {
  const std::vector<uint8_t> tga = {0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0x7f, 0xff, 0x7f, 32, 8};
  EXPECT_THROW(decode(tga), ks::Error) << "18 bytes of 32767 x 32767 pixels";
  Budget budget;
  const std::vector<uint8_t> png = bytes_of(here / "images/rgb.png");
  std::vector<uint8_t> wide = png;
  wide[16] = 0x00, wide[17] = 0x01;  // a width of 65540
  EXPECT_THROW(decode(wide), ks::Error);
}

}  // namespace
