// SPDX-License-Identifier: Apache-2.0
// The images that a model names: found as exporters of Windows mean them, and left out with a word where they cannot be read.
#include <gtest/gtest.h>

#include <algorithm>

#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;

const std::string obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";

/// collada_triangle() whose material takes its diffuse colour from an image.
std::string textured_collada(const std::string& image) {
  std::string text = collada_triangle();
  const auto put = [&](const std::string& before, const std::string& more) { text.insert(text.find(before), more); };
  put("<library_geometries>",
      "<library_images><image id=\"i\"><init_from>" + image +
          "</init_from></image></library_images><library_materials><material id=\"m\" name=\"m\"><instance_effect "
          "url=\"#e\"/></material></library_materials><library_effects><effect id=\"e\"><profile_COMMON><newparam "
          "sid=\"s\"><surface type=\"2D\"><init_from>i</init_from></surface></newparam><newparam sid=\"t\"><sampler2D>"
          "<source>s</source></sampler2D></newparam><technique sid=\"c\"><lambert><diffuse><texture texture=\"t\" "
          "texcoord=\"u0\"/></diffuse></lambert></technique></profile_COMMON></effect></library_effects>");
  text.replace(text.find("<triangles count=\"1\">"), 21, "<triangles count=\"1\" material=\"m\">");
  for (size_t at = 0; (at = text.find("<instance_geometry url=\"#g\"/>", at)) != std::string::npos;)
    text.replace(at, 29,
                 "<instance_geometry url=\"#g\"><bind_material><technique_common><instance_material symbol=\"m\" target=\"#m\"/>"
                 "</technique_common></bind_material></instance_geometry>");
  return text;
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

const Material& shown(const Loaded& loaded) { return loaded.scene.materials()[loaded.scene.instances()[0].materials[0]]; }

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
  EXPECT_NE(shown(loaded).base_color_texture, none) << (loaded.warnings.empty() ? "" : loaded.warnings[0]);
  EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings[0];
  if (std::string(kind) == "dae") {
    EXPECT_EQ(shown(loaded).base_color, glm::vec4(1.0f)) << "an image stands in place of a colour";
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
  EXPECT_NE(shown(load_textured(folder, "obj", "red.png")).base_color_texture, none);
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
  const Material& material = shown(loaded);
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
  EXPECT_NE(shown(loaded).base_color_texture, none);
  EXPECT_NE(shown(loaded).metallic_roughness_texture, none);
  EXPECT_NEAR(shown(loaded).roughness, 0.3f, 1e-6f);
  EXPECT_EQ(shown(loaded).alpha_mode, Material::AlphaMode::opaque);
  EXPECT_EQ(loaded.warnings.size(), 1u) << "said once";
}

TEST(TextureFile, AGltfTextureWithoutASourceIsLeftOut) {
  GltfWriter w;
  w.root["textures"] = json::array({json::object()});
  w.root["materials"] = {{{"normalTexture", {{"index", 0}}}}};
  w.thing(0);
  const Loaded loaded = load_glb(w);
  EXPECT_EQ(shown(loaded).normal_texture, none);
  ASSERT_EQ(loaded.warnings.size(), 1u);
  EXPECT_NE(loaded.warnings[0].find("normalTexture is left out: textures[0] has no source"), std::string::npos);
}

}  // namespace
