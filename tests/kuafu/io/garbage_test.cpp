// SPDX-License-Identifier: Apache-2.0
// Broken files: always one error that names the file, and the scene as it was. tests/fuzz changes whole files at random.
#include <gtest/gtest.h>

#include "capi/device/expect_error.h"
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

TEST(GarbageFile, MissingEmptyAndForeignFilesSayWhatTheyAre) {
  const Folder folder;
  Scene scene;
  const auto load = [&](const std::string& name) { return load_file(scene, folder / name, glm::dmat4(1.0)); };
  EXPECT_ERROR(load("none.gltf"), KS_ERROR_FILE, "none.gltf: there is no such file");
  EXPECT_ERROR(load("scene.fbx"), KS_ERROR_UNSUPPORTED, ".gltf .glb .obj .dae .stl .ply");
  std::filesystem::create_directory(folder / "folder.glb");
  EXPECT_ERROR(load("folder.glb"), KS_ERROR_FILE, "not a regular file");
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
  w.thing();
  const Folder folder;
  w.write_gltf(folder / "scene.gltf", "gone.bin");
  Scene scene;
  EXPECT_ERROR(load_file(scene, folder / "scene.gltf", glm::dmat4(1.0)), KS_ERROR_FILE, "gone.bin");
  write_text(folder / "gone.bin", "short");
  EXPECT_THROW(load_file(scene, folder / "scene.gltf", glm::dmat4(1.0)), ks::Error);
  w.root["bufferViews"][0]["byteLength"] = 1000;
  w.write_gltf(folder / "scene.gltf");
  EXPECT_ERROR(load_file(scene, folder / "scene.gltf", glm::dmat4(1.0)), KS_ERROR_FILE, "bufferViews[0]");
}

}  // namespace
