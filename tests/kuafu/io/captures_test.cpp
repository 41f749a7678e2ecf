// SPDX-License-Identifier: Apache-2.0
// The practice captures' scenes, where the data folder is there: counts and infrared albedos against their JSON, read on its own.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "io/load.h"

namespace {

std::filesystem::path data_folder() {
  if (const char* set = std::getenv("ACTIVESTEREO_DATA")) return set;
  return std::filesystem::path(__FILE__).parent_path() / "../../../../shared";
}

TEST(PracticeScenes, EveryMeshMaterialAndAlbedoIsRead) {
  const std::filesystem::path captures = data_folder() / "captures";
  if (!std::filesystem::exists(captures)) GTEST_SKIP() << "no folder " << captures << ": set ACTIVESTEREO_DATA";
  for (int number = 1; number <= 5; ++number) {
    const std::filesystem::path path = captures / ("practice-0" + std::to_string(number)) / "scene.gltf";
    SCOPED_TRACE(path);
    const nlohmann::json file = nlohmann::json::parse(std::ifstream(path));
    kuafu::Scene scene;
    EXPECT_TRUE(kuafu::load_file(scene, path, glm::dmat4(1.0)).empty()) << "nothing in them is ignored";
    ASSERT_EQ(scene.meshes().size(), file["meshes"].size());
    ASSERT_EQ(scene.instances().size(), file["nodes"].size());
    ASSERT_EQ(scene.materials().size(), file["materials"].size());
    for (size_t i = 0; i < scene.materials().size(); ++i) {
      EXPECT_FLOAT_EQ(scene.materials()[i].ir_albedo, file["materials"][i]["extras"]["ir_albedo"].get<float>());
      EXPECT_EQ(scene.materials()[i].specular, 0.0f);
      EXPECT_EQ(scene.materials()[i].name, file["materials"][i]["name"]);
    }
    for (size_t i = 0; i < scene.meshes().size(); ++i) {
      const auto& primitives = file["meshes"][i]["primitives"];
      size_t indices = 0;
      for (const auto& primitive : primitives) indices += file["accessors"][primitive["indices"].get<size_t>()]["count"].get<size_t>();
      EXPECT_EQ(scene.meshes()[i].indices.size() * 3, indices);
      EXPECT_EQ(scene.instances()[i].materials.size(), primitives.size());
      for (size_t slot = 0; slot < primitives.size(); ++slot) EXPECT_EQ(scene.instances()[i].materials[slot], primitives[slot]["material"]);
    }
  }
}

}  // namespace
