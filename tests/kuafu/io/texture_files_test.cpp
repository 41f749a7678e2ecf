// SPDX-License-Identifier: Apache-2.0
// Image files, and how scene files name them.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "capi/device/expect_error.h"
#include "device/error.h"
#include "import/image.h"
#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;

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

const std::string obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";

/// The material takes its diffuse colour from an image.
std::string textured_collada(const std::string& image) {
  return collada_with_material(
      "<newparam sid=\"s\"><surface type=\"2D\"><init_from>i</init_from></surface></newparam>"
      "<newparam sid=\"t\"><sampler2D><source>s</source></sampler2D></newparam>"
      "<technique sid=\"c\"><lambert><diffuse><texture texture=\"t\" texcoord=\"u0\"/></diffuse></lambert></technique>",
      "<library_images><image id=\"i\"><init_from>" + image + "</init_from></image></library_images>");
}

std::string textured_gltf(const std::string& image) {
  GltfWriter w;
  w.root["images"] = {{{"uri", image}}};
  w.root["textures"] = {{{"source", 0}}};
  const json texture = {{"index", 0}};
  w.root["materials"] = {{{"pbrMetallicRoughness",
                           {{"baseColorTexture", texture}, {"metallicRoughnessTexture", texture}, {"baseColorFactor", {0.5, 0.5, 0.5, 1}}}},
                          {"emissiveTexture", texture},
                          {"emissiveFactor", {1, 1, 1}}}};
  w.thing(0);
  return w.glb();
}

/// What loading a model with this image gives; `kind`: obj, dae or glb.
Loaded load_textured(const Folder& folder, const std::string& kind, const std::string& image) {
  write_text(folder / "a.mtl", "newmtl m\nKd .5 .5 .5\nmap_Kd " + image + "\nmap_Ke " + image + "\nKe 1 1 1\n");
  write_text(folder / ("a." + kind), kind == "obj" ? obj : kind == "dae" ? textured_collada(image) : textured_gltf(image));
  return load_path(folder / ("a." + kind));
}

struct Name {
  const char *written, *file;
};

class TextureName : public testing::TestWithParam<std::tuple<const char*, Name>> {};

TEST_P(TextureName, IsFound) {
  const auto& [kind, name] = GetParam();
  const Folder folder;
  std::filesystem::create_directories((folder / name.file).parent_path());
  write_text(folder / name.file, png_pixel());
  const Loaded loaded = load_textured(folder, kind, name.written);
  EXPECT_NE(loaded.material().base_color_texture, none) << (loaded.warnings.empty() ? "" : loaded.warnings[0]);
  EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings[0];
  if (std::string(kind) == "dae") {
    EXPECT_EQ(loaded.material().base_color, glm::vec4(1.0f)) << "an image stands in place of a colour";
  }
}

constexpr Name names[] = {
    {"red.png", "Red.PNG"},                                      // Windows knows no case
    {"Textures/RED.png", "textures/Red.png"},                    // nor in folders
    {"./textures/red.png", "textures/red.png"},                  //
    {"C:/Users/me/red.png", "red.png"},                          // absolute, by its end
    {"C:/Users/me/textures/Red.png", "textures/red.png"},        // the longest that is there
    {"/home/me/model/maps/red.png", "maps/red.png"},             //
    {"file:///C:/Users/me/model/maps/red.png", "maps/red.png"},  //
};
INSTANTIATE_TEST_SUITE_P(Names, TextureName, testing::Combine(testing::Values("obj", "dae", "glb"), testing::ValuesIn(names)));

constexpr Name obj_names[] = {
    {"textures\\red.png", "textures/red.png"},
    {"C:\\Users\\me\\textures\\red.png", "red.png"},
    {"\"my red.png\"", "my red.png"},
    {"red.png ", "red.png"},
    {"red.png ", "red.png "},
    {"red%20x.png", "red%20x.png"},
};
INSTANTIATE_TEST_SUITE_P(MtlNames, TextureName, testing::Combine(testing::Values("obj"), testing::ValuesIn(obj_names)));

TEST(TextureFile, TheNameAsItIsWrittenComesFirst) {
  const Folder folder;
  write_text(folder / "Red.png", "no image");
  write_text(folder / "red.png", png_pixel());
  EXPECT_NE(load_textured(folder, "obj", "red.png").material().base_color_texture, none);
}

struct Unread {
  const char *image, *bytes, *said;
};

class UnreadTexture : public testing::TestWithParam<std::tuple<const char*, Unread>> {};

TEST_P(UnreadTexture, LeavesTheColourAndIsSaid) {
  const auto& [kind, unread] = GetParam();
  const Folder outer;
  std::filesystem::create_directories(outer / "scene");
  write_text(outer / "red.png", png_pixel());
  if (unread.bytes != nullptr) write_text(outer / unread.image, unread.bytes);
  const Loaded loaded = load_textured(outer, kind, unread.image);
  const Material& material = loaded.material();
  EXPECT_EQ(material.base_color_texture, none);
  EXPECT_EQ(material.emission, glm::vec3(0.0f)) << "a missing picture of light shines everywhere";
  EXPECT_EQ(material.metallic, 0.0f);
  EXPECT_NEAR(material.base_color.g, 0.5f, 1e-6f) << "Collada has no colour beside an image: it is grey";
  EXPECT_TRUE(std::any_of(loaded.warnings.begin(), loaded.warnings.end(), [&](const std::string& warning) {
    return warning.find("left out") != std::string::npos && warning.find(unread.said) != std::string::npos;
  })) << (loaded.warnings.empty() ? "nothing" : loaded.warnings[0]);
}

constexpr Unread unread[] = {
    {"gone.png", nullptr, "cannot open 'gone.png'"},
    {"../out.png", nullptr, "outside the scene file's folder"},
    {"C:/maps/gone.png", nullptr, "cannot open 'C:/maps/gone.png'"},
    {"a.tif", "II*", "is a TIFF file, which is not read: export it as PNG, JPEG or WebP"},
    {"a.gif", "GIF89a", "is a GIF file"},
    {"a.jpg", "no image", "is not a PNG, JPEG"},
    {"a.dds", "DDS |", "is a DDS file"},
    {"a.png", "\x89PNG\r\n\x1a\n and no chunk", "texture 'a.png' cannot be read"},
};
INSTANTIATE_TEST_SUITE_P(Kinds, UnreadTexture, testing::Combine(testing::Values("obj", "dae", "glb"), testing::ValuesIn(unread)));

TEST(TextureFile, WhatIsMissingTakesNoOtherWithIt) {
  const Folder folder;
  write_text(folder / "red.png", png_pixel());
  write_text(folder / "a.mtl", "newmtl m\nmap_Kd red.png\nmap_d gone.png\nmap_Pr gone.png\nmap_Pm red.png\nPr 0.3\n");
  write_text(folder / "a.obj", obj);
  const Loaded loaded = load_path(folder / "a.obj");
  EXPECT_NE(loaded.material().base_color_texture, none);
  EXPECT_NE(loaded.material().metallic_roughness_texture, none);
  EXPECT_NEAR(loaded.material().roughness, 0.3f, 1e-6f);
  EXPECT_EQ(loaded.material().alpha_mode, Material::AlphaMode::opaque);
  EXPECT_EQ(loaded.warnings.size(), 1u) << "said once";
}

TEST(TextureFile, AGltfTextureWithoutASourceIsLeftOut) {
  GltfWriter w;
  w.root["textures"] = json::array({json::object()});
  w.root["materials"] = {{{"normalTexture", {{"index", 0}}}}};
  w.thing(0);
  const Loaded loaded = load_glb(w);
  EXPECT_EQ(loaded.material().normal_texture, none);
  ASSERT_EQ(loaded.warnings.size(), 1u);
  expect_warning(loaded, "normalTexture is left out: textures[0] has no source");
}

}  // namespace
