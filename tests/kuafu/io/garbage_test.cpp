// SPDX-License-Identifier: Apache-2.0
// Broken files: always one error that names the file, never a crash, and the scene as it was.
#include <gtest/gtest.h>

#include <random>

#include "device/error.h"
#include "io/load.h"
#include "kuafu/io/sample_files.h"

namespace {

using namespace kuafu;
using namespace scene_test;

/// Loads bytes as a file of this name. Returns the error's text, empty when it was accepted.
std::string load_bytes(const Folder& folder, const std::string& name, const std::string& bytes) {
  write_text(folder / name, bytes);
  Scene scene;
  try {
    load_file(scene, folder / name, glm::dmat4(1.0));
    return {};
  } catch (const ks::Error& error) {
    EXPECT_TRUE(scene.meshes().empty() && scene.textures().empty() && scene.materials().empty() && scene.instances().empty());
    EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
    return error.what();
  }
}

std::string rich_glb() {
  GltfWriter w;
  const std::string png = png_pixel();
  w.root["images"] = {{{"bufferView", w.view(png.data(), png.size())}, {"mimeType", "image/png"}}};
  w.root["textures"] = {{{"source", 0}}};
  w.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"baseColorFactor", {1, 1, 1, 1}}}},
                          {"extensions", {{"KHR_materials_ior", {{"ior", 1.4}}}}},
                          {"extras", {{"ir_albedo", 0.5}}}}};
  w.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"znear", 0.1}}}}};
  w.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"color", {1.0, 0.5, 0.25}}}};
  const int positions = w.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, type_float, "VEC3", 3);
  const int normals = w.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, type_float, "VEC3", 3);
  const int indices = w.accessor<uint16_t>({0, 1, 2, 2, 1, 3}, type_u16, "SCALAR", 1);
  w.mesh({{{"attributes", {{"POSITION", positions}, {"NORMAL", normals}}}, {"indices", indices}, {"material", 0}}});
  w.node({{"mesh", 0}, {"rotation", {0, 0, 0, 1}}, {"children", {1}}});
  w.root["nodes"].push_back({{"camera", 0}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  return w.glb();
}

TEST(GarbageFile, EveryTruncationOfAGlbIsAnError) {
  const Folder folder;
  const std::string whole = rich_glb();
  ASSERT_EQ(load_bytes(folder, "whole.glb", whole), "");
  for (size_t size = 0; size < whole.size(); size += size < 64 || size + 64 > whole.size() ? 1 : 17)
    EXPECT_NE(load_bytes(folder, "cut.glb", whole.substr(0, size)), "") << size << " of " << whole.size() << " bytes";
}

TEST(GarbageFile, ChangedBytesNeverCrash) {
  const Folder folder;
  const std::string whole = rich_glb();
  std::mt19937 random(1);
  int refused = 0;
  for (int round = 0; round < 1000; ++round) {
    std::string bytes = whole;
    for (unsigned n = 1 + random() % 4; n > 0; --n) {
      // Digits and braces are the bytes that a JSON parser lets through.
      static const char likely[] = "0123456789-\"{}[],:e.";
      const size_t at = random() % bytes.size();
      bytes[at] = random() % 2 ? likely[random() % (sizeof likely - 1)] : static_cast<char>(random());
    }
    refused += !load_bytes(folder, "changed.glb", bytes).empty();
  }
  EXPECT_GT(refused, 100) << "the changes reach nothing that is checked";
}

TEST(GarbageFile, RandomBytesAreAnErrorUnderEveryName) {
  const Folder folder;
  std::mt19937 random(2);
  for (const std::string extension : {"gltf", "glb", "obj", "stl", "ply", "dae"})
    for (const size_t size : {1u, 16u, 300u, 5000u}) {
      std::string bytes(size, '\0');
      for (char& c : bytes) c = static_cast<char>(random());
      EXPECT_NE(load_bytes(folder, "random." + extension, bytes), "") << extension << " " << size;
    }
}

/// Small whole files of the formats that assimp reads.
std::vector<std::pair<std::string, std::string>> mesh_files() {
  const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const unsigned char face[13] = {3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0};
  const std::string header =
      " 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int "
      "vertex_indices\nend_header\n";
  return {
      {"obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\no a\nf 1/1/1 2/2/1 3/1/1 4/2/1\n"},
      {"stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"},
      {"ply", "ply\nformat ascii" + header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"},
      {"ply", "ply\nformat binary_little_endian" + header + std::string(reinterpret_cast<const char*>(corners), sizeof corners) +
                  std::string(reinterpret_cast<const char*>(face), sizeof face)},
      {"dae", collada_triangle()},
  };
}

TEST(GarbageFile, ChangedMeshFilesNeverCrashOrHang) {
  const Folder folder;
  std::mt19937 random(3);
  for (const auto& [extension, whole] : mesh_files()) {
    ASSERT_EQ(load_bytes(folder, "whole." + extension, whole), "");
    int refused = 0;
    for (int round = 0; round < 200; ++round) {
      std::string bytes = whole;
      for (unsigned n = 1 + random() % 3; n > 0; --n) bytes[random() % bytes.size()] = "0123456789-\"<>/ \n"[random() % 17];
      if (random() % 4 == 0) bytes.resize(random() % bytes.size());
      refused += !load_bytes(folder, "changed." + extension, bytes).empty();
    }
    EXPECT_GT(refused, 20) << extension;
  }
}

TEST(GarbageFile, MissingEmptyAndForeignFilesSayWhatTheyAre) {
  const Folder folder;
  Scene scene;
  const auto error = [&](const std::string& name) -> std::string {
    try {
      load_file(scene, folder / name, glm::dmat4(1.0));
    } catch (const ks::Error& e) {
      return e.what();
    }
    return {};
  };
  EXPECT_NE(error("none.gltf").find("none.gltf: there is no such file"), std::string::npos);
  EXPECT_NE(error("scene.fbx").find(".gltf .glb .obj .dae .stl .ply"), std::string::npos);
  std::filesystem::create_directory(folder / "folder.glb");
  EXPECT_NE(error("folder.glb").find("not a regular file"), std::string::npos);
  EXPECT_NE(load_bytes(folder, "empty.gltf", "").find("is empty"), std::string::npos);
  EXPECT_NE(load_bytes(folder, "a.gltf", "{}").find("asset.version is missing"), std::string::npos);
  EXPECT_NE(load_bytes(folder, "b.gltf", R"({"asset":{"version":"1.0"}})").find("only glTF 2.x"), std::string::npos);
  EXPECT_NE(load_bytes(folder, "c.gltf", "{\"asset\":").find("not JSON"), std::string::npos);
  EXPECT_NE(load_bytes(folder, "d.gltf", std::string(1000000, '[')).find("nested deeper"), std::string::npos);
  EXPECT_NE(load_bytes(folder, "e.gltf", R"({"asset":{"version":"2.0"},"nodes":[3]})").find("nodes[0] is not an object"),
            std::string::npos);
}

TEST(GarbageFile, AMissingOrShortBufferIsNamed) {
  GltfWriter w;
  w.triangle();
  w.node({{"mesh", 0}});
  const Folder folder;
  w.write_gltf(folder / "scene.gltf", "gone.bin");
  Scene scene;
  try {
    load_file(scene, folder / "scene.gltf", glm::dmat4(1.0));
    ADD_FAILURE() << "accepted";
  } catch (const ks::Error& error) {
    EXPECT_NE(std::string(error.what()).find("gone.bin"), std::string::npos) << error.what();
  }
  write_text(folder / "gone.bin", "short");
  EXPECT_THROW(load_file(scene, folder / "scene.gltf", glm::dmat4(1.0)), ks::Error);
  w.root["bufferViews"][0]["byteLength"] = 1000;
  w.write_gltf(folder / "scene.gltf");
  try {
    load_file(scene, folder / "scene.gltf", glm::dmat4(1.0));
    ADD_FAILURE() << "accepted";
  } catch (const ks::Error& error) {
    EXPECT_NE(std::string(error.what()).find("bufferViews[0]"), std::string::npos) << error.what();
  }
}

}  // namespace
