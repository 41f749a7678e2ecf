// SPDX-License-Identifier: Apache-2.0
// glTF's WebP textures, copies by EXT_mesh_gpu_instancing, Draco's geometry, and what is said of what is not rendered.
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <gtest/gtest.h>

#include <cmath>
#include <iterator>

#include "device/error.h"
#include "io/load.h"
#include "kuafu/io/loaded.h"
#include "kuafu/io/sample_files.h"

namespace {

using namespace kuafu;
using namespace scene_test;

Loaded load(GltfWriter& w) {
  const Folder folder;
  w.write_glb(folder / "a.glb");
  return load_path(folder / "a.glb");
}

std::string error_of(GltfWriter& w) {
  try {
    load(w);
  } catch (const ks::Error& error) {
    return error.what();
  }
  return "accepted";
}

/// A triangle with the material, and one image as texture 0.
GltfWriter with_material(const json& material) {
  GltfWriter w;
  const std::string png = png_pixel();
  w.root["images"] = {{{"bufferView", w.view(png.data(), png.size())}, {"mimeType", "image/png"}}};
  w.root["textures"] = {{{"source", 0}}};
  w.root["materials"] = {material};
  w.triangle(0);
  w.node({{"mesh", 0}});
  return w;
}

json base_texture(json info) { return {{"pbrMetallicRoughness", {{"baseColorTexture", std::move(info)}}}}; }

TEST(GltfLooks, AnImageThatIsNotReadHasOneInItsPlaceOrIsAnError) {
  GltfWriter w = with_material(base_texture({{"index", 0}}));
  w.root["textures"] = {{{"source", 0}, {"extensions", {{"KHR_texture_basisu", {{"source", 7}}}}}}};
  const Loaded loaded = load(w);
  ASSERT_EQ(loaded.warnings.size(), 1u);
  EXPECT_NE(loaded.warnings[0].find("KHR_texture_basisu image is ignored"), std::string::npos) << loaded.warnings[0];
  EXPECT_EQ(loaded.scene.textures().size(), 1u);
  w.root["textures"][0].erase("source");
  EXPECT_NE(error_of(w).find("KHR_texture_basisu alone, which is not read"), std::string::npos) << error_of(w);
}

TEST(GltfLooks, WebpIsReadWhereTheExtensionNamesIt) {
  GltfWriter w = with_material(base_texture({{"index", 0}}));
  std::ifstream file(std::filesystem::path(KUAFU_TESTS) / "kuafu/io/images/rgb.webp", std::ios::binary);
  const std::string webp{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  w.root["images"].push_back({{"bufferView", w.view(webp.data(), webp.size())}, {"mimeType", "image/webp"}});
  w.root["extensionsRequired"] = {"EXT_texture_webp"};
  w.root["textures"] = {{{"source", 0}, {"extensions", {{"EXT_texture_webp", {{"source", 1}}}}}}};
  const Loaded loaded = load(w);
  EXPECT_TRUE(loaded.warnings.empty());
  EXPECT_EQ(loaded.scene.textures().at(0).width, 4u) << "the WebP image, not the PNG that stands in for it";
}

TEST(GltfLooks, WhatASamplerOrALightAsksInVainIsSaid) {
  GltfWriter w = with_material(base_texture({{"index", 0}}));
  w.root["samplers"] = {{{"magFilter", 9728}, {"wrapS", 33071}}};
  w.root["textures"][0]["sampler"] = 0;
  w.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"range", 3}}};
  w.node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  const Loaded loaded = load(w);
  ASSERT_EQ(loaded.warnings.size(), 3u);
  EXPECT_NE(loaded.warnings[0].find("clamps or mirrors"), std::string::npos) << loaded.warnings[0];
  EXPECT_NE(loaded.warnings[1].find("nearest filter"), std::string::npos) << loaded.warnings[1];
  EXPECT_NE(loaded.warnings[2].find("range is ignored"), std::string::npos) << loaded.warnings[2];
  w.root["textures"][0]["sampler"] = 3;
  EXPECT_NE(error_of(w).find("sampler 3 of 1"), std::string::npos) << error_of(w);
}

TEST(GltfLooks, EveryCopyOfAnInstancedNodeIsThere) {
  GltfWriter w;
  w.triangle();
  const float h = std::sqrt(0.5f);
  const int places = w.accessor<float>({1, 0, 0, 0, 2, 0, 0, 0, 3}, type_float, "VEC3", 3),
            turns = w.accessor<float>({0, 0, 0, 1, 0, 0, h, h, 0, 0, 0, 1}, type_float, "VEC4", 4);
  w.root["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  w.node({{"mesh", 0},
          {"translation", {0, 0, 10}},
          {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", places}, {"ROTATION", turns}}}}}}}});
  const Loaded loaded = load(w);
  ASSERT_EQ(loaded.scene.instances().size(), 3u);
  EXPECT_EQ(loaded.scene.meshes().size(), 1u);
  const auto point = [&](size_t i) { return glm::dvec3(loaded.scene.instances()[i]->local_to_world * glm::dvec4(1, 0, 0, 1)); };
  EXPECT_LT(glm::length(point(0) - glm::dvec3(2, 0, 10)), 1e-6);
  EXPECT_LT(glm::length(point(1) - glm::dvec3(0, 3, 10)), 1e-6) << "turned by a quarter about z";
  EXPECT_LT(glm::length(point(2) - glm::dvec3(1, 0, 13)), 1e-6);
  w.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = w.accessor<float>({1, 1, 1}, type_float, "VEC3", 3);
  EXPECT_NE(error_of(w).find("1 of SCALE, must be as many"), std::string::npos) << error_of(w);
}

std::vector<char> draco_triangle() {
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(1);
  const int positions = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const int uvs = builder.AddAttribute(draco::GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32);
  const float p[3][3] = {{0, 0, 0}, {2, 0, 0}, {0, 3, 0}}, t[3][2] = {{0, 0}, {1, 0}, {0, 1}};
  builder.SetAttributeValuesForFace(positions, draco::FaceIndex(0), p[0], p[1], p[2]);
  builder.SetAttributeValuesForFace(uvs, draco::FaceIndex(0), t[0], t[1], t[2]);
  const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
  draco::Encoder encoder;
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
  return {buffer.data(), buffer.data() + buffer.size()};
}

GltfWriter with_draco(const std::vector<char>& data) {
  GltfWriter w;
  const int view = w.view(data.data(), data.size());
  w.root["accessors"] = {{{"componentType", type_float}, {"count", 3}, {"type", "VEC3"}},
                         {{"componentType", type_float}, {"count", 3}, {"type", "VEC2"}},
                         {{"componentType", type_u16}, {"count", 3}, {"type", "SCALAR"}}};
  w.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  w.mesh(
      {{{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}},
        {"indices", 2},
        {"extensions", {{"KHR_draco_mesh_compression", {{"bufferView", view}, {"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}}}}}}}});
  w.node({{"mesh", 0}});
  return w;
}

TEST(GltfDraco, CompressedTrianglesAreDecodedAndBrokenOnesAreErrors) {
  std::vector<char> data = draco_triangle();
  GltfWriter w = with_draco(data);
  const Loaded loaded = load(w);
  const Mesh& mesh = loaded.scene.meshes()[0];
  ASSERT_EQ(mesh.indices.size(), 1u);
  for (int k = 0; k < 3; ++k) {
    const uint32_t i = mesh.indices[0][k];
    EXPECT_NEAR(mesh.positions[i].x, 2 * mesh.uvs[i].x, 1e-3);
    EXPECT_NEAR(mesh.positions[i].y, 3 * mesh.uvs[i].y, 1e-3);
  }
  EXPECT_NEAR(loaded.scene.bounds().max.y, 3, 1e-3);
  for (const size_t kept : {size_t{1}, size_t{3}, data.size() / 2, data.size() - 1}) {
    GltfWriter cut = with_draco(std::vector<char>(data.begin(), data.begin() + long(kept)));
    EXPECT_NE(error_of(cut).find("KHR_draco_mesh_compression"), std::string::npos) << kept << ": " << error_of(cut);
  }
  w.root["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = 9;
  EXPECT_NE(error_of(w).find("buffer view 9"), std::string::npos) << error_of(w);
}

}  // namespace
