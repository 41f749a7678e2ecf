// SPDX-License-Identifier: Apache-2.0
// OBJ, STL, PLY and Collada through assimp.
#include <gtest/gtest.h>

#include <cmath>

#include "device/error.h"
#include "io/load.h"
#include "kuafu/io/loaded.h"
#include "kuafu/io/sample_files.h"

namespace {

using namespace kuafu;
using namespace scene_test;

TEST(ObjFile, QuadsNormalsUvsAndMaterialsArrive) {
  const Folder folder;
  write_text(folder / "wood.png", png_pixel());
  write_text(folder / "box.mtl",
             "newmtl dull\nKd 0.2 0.4 0.6\nKs 0 0 0\nillum 1\nnewmtl shiny\nKd 0.5 0.5 0.5\nKs 0.3 0.3 0.3\nNs 198\nNi 1.33\nKe 1 2 "
             "3\nillum 2\nmap_Kd "
             "wood.png\nnewmtl glass\nKd 1 1 1\nd 0.25\nNi 1.45\nillum 7\n");
  write_text(folder / "box.obj",
             "mtllib box.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0.25\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\no a\nusemtl dull\nf 1/1/1 "
             "2/2/1 3/3/1 4/4/1\n"
             "o b\nusemtl shiny\nf 1/1/1 2/2/1 3/3/1\no c\nusemtl glass\nf 1/1/1 2/2/1 3/3/1\n");
  glm::dmat4 root(1.0);
  root[3] = {0, 0, 2, 1};
  const Loaded loaded = load_path(folder / "box.obj", root);
  const Scene& scene = loaded.scene;
  ASSERT_EQ(scene.instances().size(), 3u);
  EXPECT_EQ(scene.meshes()[0].indices.size(), 2u) << "a quad is two triangles";
  ASSERT_EQ(scene.meshes()[0].normals.size(), scene.meshes()[0].positions.size());
  EXPECT_EQ(scene.meshes()[0].normals[0], glm::vec3(0, 0, 1));
  for (size_t i = 0; i < scene.meshes()[0].positions.size(); ++i) {
    if (scene.meshes()[0].positions[i] == glm::vec3(0)) {
      EXPECT_NEAR(scene.meshes()[0].uvs[i].y, 0.75f, 1e-6f) << "v points down";
    }
  }
  EXPECT_EQ(scene.bounds().min, glm::dvec3(0, 0, 2));
  const auto material = [&](size_t i) -> const Material& { return scene.materials()[scene.instances()[i].materials[0]]; };
  EXPECT_EQ(material(0).name, "dull");
  EXPECT_EQ(material(0).base_color, glm::vec4(0.2f, 0.4f, 0.6f, 1));
  EXPECT_EQ(material(0).specular, 0.0f) << "no highlight is exactly Lambertian";
  EXPECT_EQ(material(0).metallic, 0.0f);
  EXPECT_NEAR(material(1).specular, 0.3f, 1e-6f);
  EXPECT_NEAR(material(1).roughness, std::pow(2.0 / 200.0, 0.25), 1e-5);
  EXPECT_NEAR(material(1).ior, 1.33f, 1e-6f);
  EXPECT_EQ(material(1).emission, glm::vec3(1, 2, 3));
  ASSERT_NE(material(1).base_color_texture, none);
  EXPECT_TRUE(scene.textures()[material(1).base_color_texture].srgb);
  EXPECT_NEAR(material(2).transmission, 0.75f, 1e-6f);
  EXPECT_EQ(material(2).roughness, 0.0f);
  EXPECT_NEAR(material(2).ior, 1.45f, 1e-6f);
}

TEST(ObjFile, OnlyBlackWithTracedReflectionsIsAMirror) {
  const std::string looks = "Kd 0 0 0\nKs 0.9 0.8 0.7\nNs 100000\n";
  for (const auto& [illum, metallic] : {std::pair{"illum 2\n", 0.0f}, {"illum 3\n", 1.0f}, {"illum 3\nPm 0\n", 0.0f}}) {
    const Folder folder;
    write_text(folder / "a.mtl", "newmtl m\n" + looks + illum);
    write_text(folder / "a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl m\nf 1 2 3\n");
    const Material m = load_path(folder / "a.obj").scene.materials()[0];
    EXPECT_EQ(m.metallic, metallic) << illum;
    EXPECT_EQ(m.base_color[0], metallic == 1.0f ? 0.9f : 0.0f) << illum;
    EXPECT_LT(m.roughness, 0.1f);
  }
}

/// An uncompressed grey TGA of one row.
std::string grey_row(const std::vector<unsigned char>& values) {
  std::string out(18, '\0');
  out[2] = 3;
  out[12] = static_cast<char>(values.size());
  out[14] = 1;
  out[16] = 8;
  return out + std::string(values.begin(), values.end());
}

std::vector<uint8_t> texel(const Scene& scene, uint32_t id, uint32_t x = 0) {
  const Texture& t = scene.textures()[id];
  return {t.texels.begin() + x * t.channels, t.texels.begin() + (x + 1) * t.channels};
}

TEST(ObjFile, EveryMapOfAMaterialArrives) {
  const Folder folder;
  write_text(folder / "d.tga", grey_row({40, 255, 100, 100}));
  write_text(folder / "r.tga", grey_row({50}));
  write_text(folder / "m.tga", grey_row({200}));
  write_text(folder / "pixel.png", png_pixel());
  write_text(folder / "a.mtl",
             "newmtl all\nKd 1 1 1\nKs 1 1 1\nillum 2\nmap_Kd pixel.png\nmap_d d.tga\nmap_Ks pixel.png\nmap_Pr r.tga\nmap_Pm m.tga\n"
             "map_bump -bm 2 d.tga\n"
             "newmtl cut\nKd 1 1 1\nillum 2\nd 0.25\n"
             "newmtl mask\nKd 1 1 1\nillum 2\nmap_d d.tga\n"
             "newmtl directed\nKd 1 1 1\nillum 2\nnorm pixel.png\n");
  std::string obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (const char* name : {"all", "cut", "mask", "directed"}) obj += std::string("o ") + name + "\nusemtl " + name + "\nf 1 2 3\n";
  write_text(folder / "a.obj", obj);
  const Loaded loaded = load_path(folder / "a.obj");
  EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings[0];
  const Scene& scene = loaded.scene;
  const auto material = [&](size_t i) -> const Material& { return scene.materials()[scene.instances()[i].materials[0]]; };
  const Material& all = material(0);
  EXPECT_EQ(all.alpha_mode, Material::AlphaMode::blend);
  EXPECT_EQ(texel(scene, all.base_color_texture), (std::vector<uint8_t>{10, 20, 30, 40})) << "map_d is map_Kd's alpha";
  EXPECT_TRUE(scene.textures()[all.base_color_texture].srgb);
  EXPECT_EQ(texel(scene, all.specular_texture)[3], 20) << "the mean of 10, 20 and 30";
  EXPECT_EQ(texel(scene, all.metallic_roughness_texture)[1], 50);
  EXPECT_EQ(texel(scene, all.metallic_roughness_texture)[2], 200);
  EXPECT_EQ(all.roughness, 1.0f);
  EXPECT_EQ(all.metallic, 1.0f);
  // Heights 0.157, 1, 0.392, 0.392: at the first texel the slope is (1 - 0.392) / 2 per texel, twice as steep by -bm 2.
  const double slope = 155 / 255.0, length = std::hypot(slope, 1.0);
  const std::vector<uint8_t> normal = texel(scene, all.normal_texture);
  EXPECT_NEAR(normal[0], 255 * (0.5 - 0.5 * slope / length), 1);
  EXPECT_NEAR(normal[1], 127.5, 1);
  EXPECT_NEAR(normal[2], 255 * (0.5 + 0.5 / length), 1);
  EXPECT_EQ(material(1).alpha_mode, Material::AlphaMode::blend);
  EXPECT_EQ(material(1).base_color.a, 0.25f);
  EXPECT_EQ(texel(scene, material(2).base_color_texture, 2), (std::vector<uint8_t>{255, 255, 255, 100}));
  EXPECT_EQ(texel(scene, material(3).normal_texture), (std::vector<uint8_t>{10, 20, 30, 255}));
}

TEST(PlyFile, ColoursOfVerticesAreLinearAndShown) {
  const Folder folder;
  write_text(folder / "a.ply",
             "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
             "property uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
             "0 0 0 255 0 0\n1 0 0 0 128 0\n0 1 0 0 0 0\n3 0 1 2\n");
  const Loaded loaded = load_path(folder / "a.ply");
  const Mesh& mesh = loaded.scene.meshes()[0];
  ASSERT_EQ(mesh.colors.size(), mesh.positions.size());
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    EXPECT_NEAR(mesh.colors[i].r, mesh.positions[i] == glm::vec3(0) ? 1.0 : 0.0, 1e-6);
    EXPECT_NEAR(mesh.colors[i].g, mesh.positions[i].x == 1.0f ? 0.21586 : 0.0, 1e-4);
  }
  const uint32_t material = loaded.scene.instances()[0].materials.at(0);
  ASSERT_NE(material, none);
  EXPECT_EQ(loaded.scene.materials()[material].base_color, glm::vec4(1)) << "the grey of surfaces without a material would dim them";
}

TEST(StlFile, FacetsAreTrianglesOfTheDefaultMaterial) {
  const Folder folder;
  write_text(folder / "a.stl",
             "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n");
  const Loaded loaded = load_path(folder / "a.stl");
  ASSERT_EQ(loaded.scene.instances().size(), 1u);
  EXPECT_EQ(loaded.scene.meshes()[0].indices.size(), 1u);
  EXPECT_EQ(loaded.scene.instances()[0].materials, std::vector<uint32_t>{none});
}

TEST(ColladaFile, NodesCarryTheirTransformsUnitsAndUpAxis) {
  const Folder folder;
  write_text(folder / "a.dae", collada_triangle());
  const Loaded loaded = load_path(folder / "a.dae");
  ASSERT_EQ(loaded.scene.instances().size(), 2u);
  EXPECT_EQ(loaded.scene.meshes().size(), 1u) << "two nodes share one geometry";
  const Bounds bounds = loaded.scene.bounds();
  EXPECT_NEAR(bounds.max.y, 2.0, 1e-6) << "the file's z axis points up, and 200 cm are 2 m";
  EXPECT_NEAR(bounds.max.x, 1.0, 1e-6);
}

}  // namespace
