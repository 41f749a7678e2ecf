// SPDX-License-Identifier: Apache-2.0
// The scene through the C API: every field that the capture format names, ids, instancing, names.
#include <gtest/gtest.h>

#include <cmath>

#include "kuafu/io/sample_files.h"
#include "kuafu/kuafu.h"

namespace {

using namespace scene_test;

class SceneApi : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(kuafu_device_create(nullptr, &device_), KS_OK) << kuafu_last_error();
    ASSERT_EQ(kuafu_scene_create(device_, &scene_), KS_OK) << kuafu_last_error();
  }
  void TearDown() override {
    kuafu_device_release(device_);  // the scene keeps its device: any order is legal
    kuafu_scene_release(scene_);
  }
  kuafu_scene_summary summary() {
    kuafu_scene_summary s = kuafu_scene_summary_init();
    EXPECT_EQ(kuafu_scene_get_summary(scene_, &s), KS_OK) << kuafu_last_error();
    return s;
  }
  uint32_t add_triangle() {
    const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const uint32_t indices[] = {0, 1, 2};
    kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
    mesh.positions = positions;
    mesh.indices = indices;
    mesh.vertex_count = 3;
    mesh.triangle_count = 1;
    uint32_t id = 0;
    EXPECT_EQ(kuafu_scene_add_mesh(scene_, &mesh, &id), KS_OK) << kuafu_last_error();
    return id;
  }
  kuafu_material_desc material(uint32_t id) {
    kuafu_material_desc m = kuafu_material_desc_init();
    EXPECT_EQ(kuafu_scene_get_material(scene_, id, &m), KS_OK) << kuafu_last_error();
    return m;
  }
  void expect_invalid(ks_status status, const std::string& part) {
    EXPECT_EQ(status, KS_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(std::string(kuafu_last_error()).find(part), std::string::npos) << kuafu_last_error();
  }

  kuafu_device device_ = nullptr;
  kuafu_scene scene_ = nullptr;
};

TEST_F(SceneApi, ReadsBackEveryMaterialFieldThatTheCaptureFormatNames) {
  GltfWriter w;
  w.texture();
  const json texture = {{"index", 0}};
  w.root["materials"] = {{{"name", "full"},
                          {"pbrMetallicRoughness",
                           {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}},
                            {"metallicFactor", 0.5},
                            {"roughnessFactor", 0.6},
                            {"baseColorTexture", texture},
                            {"metallicRoughnessTexture", texture}}},
                          {"normalTexture", texture},
                          {"emissiveTexture", texture},
                          {"emissiveFactor", {0.1, 0.2, 0.4}},
                          {"extensions",
                           {{"KHR_materials_ior", {{"ior", 1.33}}},
                            {"KHR_materials_transmission", {{"transmissionFactor", 0.7}, {"transmissionTexture", texture}}},
                            {"KHR_materials_specular", {{"specularFactor", 0.25}, {"specularTexture", texture}}},
                            {"KHR_materials_emissive_strength", {{"emissiveStrength", 10}}}}},
                          {"extras", {{"ir_albedo", 0.66}, {"ir_emission", 3.5}}}},
                         {{"name", "plain"}, {"extensions", {{"KHR_materials_specular", {{"specularFactor", 0}}}}}}};
  w.triangle(0);
  w.node({{"mesh", 0}, {"name", "shown"}});
  const Folder folder;
  w.write_gltf(folder / "scene.gltf");
  ASSERT_EQ(kuafu_scene_load(scene_, (folder / "scene.gltf").c_str(), nullptr, nullptr), KS_OK) << kuafu_last_error();
  const kuafu_material_desc m = material(1);
  EXPECT_STREQ(m.name, "full");
  for (int i = 0; i < 4; ++i) EXPECT_FLOAT_EQ(m.base_color[i], 0.1f * static_cast<float>(i + 1));
  EXPECT_FLOAT_EQ(m.metallic, 0.5f);
  EXPECT_FLOAT_EQ(m.roughness, 0.6f);
  EXPECT_FLOAT_EQ(m.ior, 1.33f);
  EXPECT_FLOAT_EQ(m.transmission, 0.7f);
  EXPECT_FLOAT_EQ(m.specular, 0.25f);
  EXPECT_FLOAT_EQ(m.emission[0], 1.0f);
  EXPECT_FLOAT_EQ(m.emission[2], 4.0f);
  EXPECT_FLOAT_EQ(m.ir_albedo, 0.66f);
  EXPECT_FLOAT_EQ(m.ir_emission, 3.5f);
  const uint32_t colour = m.base_color_texture, data = m.metallic_roughness_texture;
  EXPECT_NE(colour, 0u);
  EXPECT_NE(data, 0u);
  EXPECT_NE(colour, data) << "sRGB and linear";
  EXPECT_EQ(m.emission_texture, colour);
  EXPECT_EQ(m.normal_texture, data);
  EXPECT_EQ(m.transmission_texture, data);
  EXPECT_EQ(m.specular_texture, data);
  EXPECT_EQ(summary().texture_count, 2u);
  EXPECT_EQ(material(2).specular, 0.0f);
  EXPECT_TRUE(std::isnan(material(2).ir_albedo)) << "red of the base colour";
  EXPECT_STREQ(kuafu_scene_material_name(scene_, 2), "plain");
  EXPECT_STREQ(kuafu_scene_instance_name(scene_, 1), "shown");
}

TEST_F(SceneApi, SummaryCountsTrianglesOfInstancesInTheWorld) {
  const kuafu_scene_summary empty = summary();
  EXPECT_EQ(empty.instance_count, 0u);
  EXPECT_TRUE(std::isinf(empty.bounds_min_m[0]) && empty.bounds_min_m[0] > 0);
  GltfWriter w;
  w.triangle();
  w.node({{"mesh", 0}, {"children", {1}}, {"translation", {0, 0, 1}}});
  w.root["nodes"].push_back({{"mesh", 0}, {"scale", {2, 2, 2}}, {"translation", {0, 0, 1}}});
  const Folder folder;
  w.write_glb(folder / "scene.glb");
  const double root[16] = {1, 0, 0, 10, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  ASSERT_EQ(kuafu_scene_load(scene_, (folder / "scene.glb").c_str(), nullptr, root), KS_OK) << kuafu_last_error();
  const kuafu_scene_summary s = summary();
  EXPECT_EQ(s.mesh_count, 1u) << "two nodes share it";
  EXPECT_EQ(s.instance_count, 2u);
  EXPECT_EQ(s.triangle_count, 2u);
  EXPECT_EQ(s.bounds_min_m[0], 10.0);
  EXPECT_EQ(s.bounds_max_m[0], 12.0);
  EXPECT_EQ(s.bounds_max_m[2], 2.0);
}

TEST_F(SceneApi, AFailedLoadLeavesTheSceneAndNamesTheFile) {
  add_triangle();
  GltfWriter w = with_materials({{{"name", "good"}}, {{"pbrMetallicRoughness", {{"roughnessFactor", 2}}}}});
  const Folder folder;
  w.write_gltf(folder / "bad.gltf");
  EXPECT_EQ(kuafu_scene_load(scene_, (folder / "bad.gltf").c_str(), nullptr, nullptr), KS_ERROR_FILE);
  EXPECT_NE(std::string(kuafu_last_error()).find("bad.gltf"), std::string::npos) << kuafu_last_error();
  EXPECT_EQ(kuafu_scene_load(scene_, (folder / "bad.gltf").c_str(), "the user's.usd", nullptr), KS_ERROR_FILE);
  EXPECT_EQ(std::string(kuafu_last_error()).find("the user's.usd: "), 0u) << kuafu_last_error();
  EXPECT_EQ(std::string(kuafu_last_error()).find("bad.gltf"), std::string::npos) << kuafu_last_error();
  EXPECT_EQ(summary().mesh_count, 1u);
  EXPECT_EQ(summary().material_count, 0u);
  expect_invalid(kuafu_scene_load(scene_, nullptr, nullptr, nullptr), "path is NULL");
}

TEST_F(SceneApi, LightsAndMaterialsAreSetAndReadBack) {
  const uint8_t texel = 200;
  kuafu_texture_desc texture = kuafu_texture_desc_init();
  texture.texels = &texel;
  texture.width = texture.height = texture.channels = 1;
  texture.format = KS_FORMAT_U8;
  uint32_t pattern = 0, id = 0;
  ASSERT_EQ(kuafu_scene_add_texture(scene_, &texture, &pattern), KS_OK) << kuafu_last_error();
  kuafu_light_desc light = kuafu_light_desc_init(KUAFU_LIGHT_PROJECTOR);
  light.name = "ir";
  light.texture = pattern;
  light.ir_intensity = 2.5f;
  light.light_to_world[3] = -0.03;
  light.k[0] = light.k[4] = 500;
  light.k[2] = 320;
  ASSERT_EQ(kuafu_scene_add_light(scene_, &light, &id), KS_OK) << kuafu_last_error();
  kuafu_light_desc back = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
  ASSERT_EQ(kuafu_scene_get_light(scene_, id, &back), KS_OK) << kuafu_last_error();
  EXPECT_EQ(back.kind, KUAFU_LIGHT_PROJECTOR);
  EXPECT_STREQ(back.name, "ir");
  EXPECT_EQ(back.texture, pattern);
  EXPECT_EQ(back.ir_intensity, 2.5f);
  EXPECT_EQ(back.light_to_world[3], -0.03);
  EXPECT_EQ(back.k[2], 320.0);
  light.ir_intensity = -1;
  expect_invalid(kuafu_scene_set_light(scene_, id, &light), "ir_intensity is -1");
  kuafu_material_desc m = kuafu_material_desc_init();
  ASSERT_EQ(kuafu_scene_add_material(scene_, &m, &id), KS_OK);
  m.ir_albedo = 0.3f;
  ASSERT_EQ(kuafu_scene_set_material(scene_, id, &m), KS_OK);
  EXPECT_EQ(material(id).ir_albedo, 0.3f);
  kuafu_environment_desc environment = kuafu_environment_desc_init();
  EXPECT_EQ(kuafu_scene_set_environment(scene_, &environment), KS_OK);
  environment.radiance[1] = NAN;
  expect_invalid(kuafu_scene_set_environment(scene_, &environment), "radiance");
}

TEST_F(SceneApi, ManyInstancesMoveAtOnceOrNone) {
  const kuafu_instance_desc instance = kuafu_instance_desc_init(add_triangle());
  uint32_t ids[2];
  for (uint32_t& id : ids) ASSERT_EQ(kuafu_scene_add_instance(scene_, &instance, &id), KS_OK) << kuafu_last_error();
  double poses[2][16] = {};
  for (int i = 0; i < 2; ++i) {
    poses[i][0] = poses[i][5] = poses[i][10] = poses[i][15] = 1.0;
    poses[i][3] = 10.0 * (i + 1);
  }
  ASSERT_EQ(kuafu_scene_set_instance_poses(scene_, ids, poses[0], 2), KS_OK) << kuafu_last_error();
  EXPECT_EQ(summary().bounds_min_m[0], 10.0);
  EXPECT_EQ(summary().bounds_max_m[0], 21.0);
  poses[0][3] = -5.0, poses[1][7] = NAN;
  expect_invalid(kuafu_scene_set_instance_poses(scene_, ids, poses[0], 2), "not finite");
  EXPECT_EQ(summary().bounds_min_m[0], 10.0);
  const uint32_t unknown[2] = {ids[0], 99};
  poses[1][7] = 0.0;
  expect_invalid(kuafu_scene_set_instance_poses(scene_, unknown, poses[0], 2), "there is no instance 99");
  EXPECT_EQ(summary().bounds_min_m[0], 10.0);
  expect_invalid(kuafu_scene_set_instance_poses(scene_, nullptr, poses[0], 2), "ids is NULL");
  EXPECT_EQ(kuafu_scene_set_instance_poses(scene_, nullptr, nullptr, 0), KS_OK) << kuafu_last_error();
}

TEST_F(SceneApi, ManyLightsChangeAtOnceOrNone) {
  kuafu_light_desc lights[2] = {kuafu_light_desc_init(KUAFU_LIGHT_POINT), kuafu_light_desc_init(KUAFU_LIGHT_POINT)};
  uint32_t ids[2];
  for (int i = 0; i < 2; ++i) ASSERT_EQ(kuafu_scene_add_light(scene_, &lights[i], &ids[i]), KS_OK) << kuafu_last_error();
  const auto red = [&](int i) {
    kuafu_light_desc back = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
    EXPECT_EQ(kuafu_scene_get_light(scene_, ids[i], &back), KS_OK) << kuafu_last_error();
    return back.intensity[0];
  };
  for (int i = 0; i < 2; ++i) lights[i].intensity[0] = 3.0f + static_cast<float>(i);
  ASSERT_EQ(kuafu_scene_set_lights(scene_, ids, lights, 2), KS_OK) << kuafu_last_error();
  EXPECT_EQ(red(0), 3.0f);
  EXPECT_EQ(red(1), 4.0f);
  lights[0].intensity[0] = 7.0f, lights[1].intensity[0] = -1.0f;
  expect_invalid(kuafu_scene_set_lights(scene_, ids, lights, 2), "intensity");
  EXPECT_EQ(red(0), 3.0f);
  expect_invalid(kuafu_scene_set_lights(scene_, ids, nullptr, 2), "descs is NULL");
}

TEST_F(SceneApi, RemovedIdsAreRefusedAndNeverComeBack) {
  const kuafu_instance_desc instance = kuafu_instance_desc_init(add_triangle());
  uint32_t first = 0, second = 0;
  ASSERT_EQ(kuafu_scene_add_instance(scene_, &instance, &first), KS_OK) << kuafu_last_error();
  ASSERT_EQ(kuafu_scene_remove_instance(scene_, first), KS_OK);
  expect_invalid(kuafu_scene_remove_instance(scene_, first), "removed");
  const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  expect_invalid(kuafu_scene_set_instance_pose(scene_, first, identity), "removed");
  EXPECT_EQ(kuafu_scene_instance_name(scene_, first), nullptr);
  ASSERT_EQ(kuafu_scene_add_instance(scene_, &instance, &second), KS_OK);
  EXPECT_NE(second, first);
  EXPECT_EQ(summary().instance_count, 1u);
}

TEST_F(SceneApi, NullAndForeignStructsAreErrors) {
  uint32_t id = 7;
  expect_invalid(kuafu_scene_add_mesh(scene_, nullptr, &id), "mesh desc is NULL");
  EXPECT_EQ(id, 0u);
  kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
  mesh.vertex_count = 3;
  mesh.triangle_count = 1;
  expect_invalid(kuafu_scene_add_mesh(scene_, &mesh, &id), "positions is NULL");
  expect_invalid(kuafu_scene_add_mesh(scene_, &mesh, nullptr), "id is NULL");
  kuafu_material_desc wrong = kuafu_material_desc_init();
  wrong.header.type = KUAFU_TYPE_LIGHT_DESC;
  expect_invalid(kuafu_scene_add_material(scene_, &wrong, &id), "struct type");
  kuafu_texture_desc texture = kuafu_texture_desc_init();
  texture.width = texture.height = 0xffffffffu;
  texture.channels = 4;
  texture.format = KS_FORMAT_F32;
  expect_invalid(kuafu_scene_add_texture(scene_, &texture, &id), "size is 4294967295x4294967295");
  texture.format = KS_FORMAT_I16;
  expect_invalid(kuafu_scene_add_texture(scene_, &texture, &id), "texture format is 3");
  expect_invalid(kuafu_scene_get_summary(nullptr, nullptr), "scene is NULL");
  kuafu_scene none = nullptr;
  expect_invalid(kuafu_scene_create(nullptr, &none), "device is NULL");
  kuafu_scene_release(nullptr);
}

}  // namespace
