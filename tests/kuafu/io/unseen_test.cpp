// SPDX-License-Identifier: Apache-2.0
// Whole materials of opacity 0, as exporters write opaque ones by mistake, are drawn opaque and said, in every format.
#include <gtest/gtest.h>

#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;

std::string collada(const std::string& transparent) {
  std::string text = collada_triangle();
  const std::string effect =
      "<library_effects><effect id=\"e\"><profile_COMMON><technique sid=\"c\"><lambert><diffuse><color>0.5 0.5 0.5 1</color></diffuse>" +
      transparent + "</lambert></technique></profile_COMMON></effect></library_effects>" +
      "<library_materials><material id=\"k\" name=\"m\"><instance_effect url=\"#e\"/></material></library_materials>";
  text.insert(text.find("<library_geometries>"), effect);
  const std::string bound =
      "<instance_geometry url=\"#g\">"
      "<bind_material><technique_common><instance_material symbol=\"s\" target=\"#k\"/></technique_common></bind_material>"
      "</instance_geometry>";
  for (size_t at = 0; (at = text.find("<instance_geometry url=\"#g\"/>", at)) != std::string::npos; at += bound.size())
    text.replace(at, std::string("<instance_geometry url=\"#g\"/>").size(), bound);
  text.insert(text.find("<triangles count=\"1\"") + std::string("<triangles").size(), " material=\"s\"");
  return text;
}

/// A triangle of a material with these fields.
std::string gltf(json material) {
  GltfWriter w;
  material["name"] = "m";
  w.root["materials"] = {material};
  const int positions = w.accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, 5126, "VEC3", 3);
  w.root["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", positions}}}, {"material", 0}}}}}};
  w.node({{"mesh", 0}});
  const Folder folder;
  w.write_glb(folder / "a.glb");
  std::ifstream file(folder / "a.glb", std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string mtl(const std::string& opacity) { return "newmtl m\nKd 0.5 0.5 0.5\nillum 2\n" + opacity + "\n"; }

Loaded loaded(const Folder& folder, const std::string& file, const std::string& text, bool keep) {
  write_text(folder / "a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
  write_text(folder / file, text);
  Loaded out;
  out.warnings = load_file(out.scene, folder / (file == "a.mtl" ? "a.obj" : file), glm::dmat4(1.0), {.keep_transparent = keep});
  return out;
}

class Opacity0 : public testing::TestWithParam<std::pair<const char*, std::string>> {};

TEST_P(Opacity0, IsDrawnOpaqueAndSaid) {
  const auto& [file, text] = GetParam();
  for (const bool keep : {false, true}) {
    const Folder folder;
    const Loaded got = loaded(folder, file, text, keep);
    ASSERT_EQ(got.warnings.size(), 1u) << file;
    EXPECT_NE(got.warnings[0].find("opacity 0"), std::string::npos) << got.warnings[0];
    const Material& m = got.scene.materials()[got.scene.instances()[0].materials[0]];
    EXPECT_EQ(m.alpha_mode == Material::AlphaMode::opaque, !keep) << file << text;
    EXPECT_EQ(m.base_color.a, keep ? 0.0f : 1.0f);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Habits, Opacity0,
    testing::Values(std::pair{"a.mtl", mtl("Tr 1.000000")}, std::pair{"a.mtl", mtl("d 0")},
                    std::pair{"a.dae", collada("<transparency><float>0</float></transparency>")},
                    std::pair{"a.dae", collada("<transparent opaque=\"A_ONE\"><color>1 1 1 1</color></transparent>"
                                               "<transparency><float>0</float></transparency>")},
                    std::pair{"a.dae", collada("<transparent opaque=\"RGB_ZERO\"><color>1 1 1 1</color></transparent>"
                                               "<transparency><float>1</float></transparency>")},
                    std::pair{"a.glb", gltf({{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0}}}}})},
                    std::pair{"a.glb", gltf({{"alphaMode", "MASK"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0}}}}})}));

TEST(Area, OfNoTriangleIsSaid) {
  const Folder folder;
  write_text(folder / "a.obj", "o line\nv 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\no triangle\nv 0 1 0\nf 1 2 4\n");
  const std::vector<std::string> warnings = load_path(folder / "a.obj").warnings;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("mesh 'line' has no area"), std::string::npos) << warnings[0];
}

TEST(Opacity, ThatIsMeantStays) {
  for (const std::string& text : {mtl("d 0.25"), mtl("Tr 0.75")}) {
    const Folder folder;
    const Loaded got = loaded(folder, "a.mtl", text, false);
    EXPECT_TRUE(got.warnings.empty());
    EXPECT_EQ(got.scene.materials()[got.scene.instances()[0].materials[0]].base_color.a, 0.25f);
  }
}

}  // namespace
