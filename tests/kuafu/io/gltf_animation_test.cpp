// SPDX-License-Identifier: Apache-2.0
// Animations, skins and morph targets of glTF files: what a scene shows without them, and at a time.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "kuafu/io/loaded.h"
#include "scene/rig.h"

namespace {

using namespace kuafu;
using namespace scene_test;

struct Channel {
  int node;
  const char* path;
  std::vector<float> times, values;
  size_t width;
  const char* interpolation = "LINEAR";
};

void animation(GltfWriter& w, const std::string& name, const std::vector<Channel>& channels) {
  json all = {{"name", name}, {"channels", json::array()}, {"samplers", json::array()}};
  for (const Channel& c : channels) {
    const bool scalar = std::string(c.path) == "weights";
    const char* type = scalar ? "SCALAR" : c.width == 4 ? "VEC4" : "VEC3";
    const int input = w.accessor(c.times, type_float, "SCALAR", 1), output = w.accessor(c.values, type_float, type, scalar ? 1 : c.width);
    all["channels"].push_back({{"sampler", all["samplers"].size()}, {"target", {{"node", c.node}, {"path", c.path}}}});
    all["samplers"].push_back({{"input", input}, {"output", output}, {"interpolation", c.interpolation}});
  }
  w.root["animations"].push_back(all);
}

const float half_turn = std::sqrt(0.5f);  // sine and cosine of half of 90 degrees

TEST(GltfAnimation, InstancesLightsAndCamerasFollowTheirNodes) {
  GltfWriter w;
  w.triangle();
  w.camera();
  w.lights({{{"type", "spot"}, {"spot", json::object()}}});
  w.root["extensionsUsed"] = {"KHR_lights_punctual"};
  w.node({{"name", "arm"}, {"translation", {1, 0, 0}}, {"children", {1}}});
  w.root["nodes"].push_back(
      {{"name", "hand"}, {"translation", {0, 2, 0}}, {"scale", {2, 2, 2}}, {"mesh", 0}, {"camera", 0}, {"extensions", light_0()}});
  w.node({{"name", "still"}, {"mesh", 0}});
  animation(w, "turn", {{0, "rotation", {0, 2}, {0, 0, 0, 1, 0, 0, half_turn, half_turn}, 4}});
  glm::dmat4 root(1.0);
  root[3] = {0, 0, 5, 1};
  Loaded loaded = load_glb(w, root);
  EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings[0];
  Scene& scene = loaded.scene;
  const glm::dmat4 first = scene.instances()[0].local_to_world;
  EXPECT_EQ(first[3], glm::dvec4(1, 2, 5, 1));
  scene.animate(0, 2.0);  // by 90 degrees about z
  const glm::dmat4 hand =
      root * glm::scale(glm::translate(glm::rotate(glm::translate(glm::dmat4(1), {1, 0, 0}), glm::radians(90.0), {0, 0, 1}), {0, 2, 0}),
                        {2, 2, 2});
  for (int c = 0; c < 4; ++c) EXPECT_LT(glm::length(scene.instances()[0].local_to_world[c] - hand[c]), 1e-6);
  EXPECT_LT(glm::length(scene.lights()[0].light_to_world[3] - hand[3]), 1e-6);
  EXPECT_LT(glm::length(scene.cameras()[0].camera_to_world[3] - hand[3]), 1e-6);
  EXPECT_LT(glm::length(scene.cameras()[0].camera_to_world[0] - glm::dvec4(0, 1, 0, 0)), 1e-6);  // the node's x, without its scale
  EXPECT_EQ(scene.instances()[0].previous_local_to_world, first);                                // for motion vectors
  EXPECT_EQ(scene.instances()[1].local_to_world, root);
  scene.animate(none, 0.0);
  for (int c = 0; c < 4; ++c) EXPECT_LT(glm::length(scene.instances()[0].local_to_world[c] - first[c]), 1e-12);
  EXPECT_THROW(scene.animate(1, 0.0), ks::Error);
  EXPECT_THROW(scene.animate(0, NAN), ks::Error);
}

/// A strip of two triangles along y, whose upper vertices hang on a second joint one unit above the first.
GltfWriter strip() {
  GltfWriter w;
  const int positions = w.accessor<float>({0, 0, 0, 1, 0, 0, 0, 2, 0, 1, 2, 0}, type_float, "VEC3", 3),
            joints = w.accessor<uint8_t>({0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0}, type_u8, "VEC4", 4),
            weights = w.accessor<float>({1, 0, 0, 0, 1, 0, 0, 0, 0.25f, 0.75f, 0, 0, 0, 1, 0, 0}, type_float, "VEC4", 4),
            indices = w.accessor<uint16_t>({0, 1, 2, 2, 1, 3}, type_u16, "SCALAR", 1),
            target = w.accessor<float>({0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1}, type_float, "VEC3", 3);
  const std::vector<float> binds = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1};
  const int inverse = w.accessor(binds, type_float, "MAT4", 16);
  w.mesh({{{"attributes", {{"POSITION", positions}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}},
           {"indices", indices},
           {"targets", {{{"POSITION", target}}}}}});
  w.root["skins"] = {{{"joints", {1, 2}}, {"inverseBindMatrices", inverse}}};
  w.node({{"name", "strip"}, {"mesh", 0}, {"skin", 0}, {"translation", {9, 9, 9}}});  // which its skin makes up for
  w.node({{"name", "low"}, {"children", {2}}});
  w.root["nodes"].push_back({{"name", "high"}, {"translation", {0, 1, 0}}});
  return w;
}

TEST(GltfAnimation, SkinsBendAndTargetsMoveVertices) {
  GltfWriter w = strip();
  animation(w, "bend", {{2, "rotation", {0, 1}, {0, 0, 0, 1, 0, 0, half_turn, half_turn}, 4}, {0, "weights", {0, 1}, {0, 0.5f}, 1}});
  Loaded loaded = load_glb(w);
  EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings[0];
  Scene& scene = loaded.scene;
  EXPECT_EQ(scene.instances()[0].local_to_world, glm::dmat4(1.0));
  EXPECT_EQ(scene.meshes()[0].positions[3], glm::vec3(1, 2, 0));
  scene.animate(0, 1.0);
  const std::vector<glm::vec3>& p = scene.meshes()[0].positions;
  EXPECT_EQ(p[1], glm::vec3(1, 0, 0));
  // (1, 2, 0.5) is (1, 1, 0.5) in the joint, there (-1, 1, 0.5) when it has turned: half a unit up by the target.
  EXPECT_LT(glm::length(p[3] - glm::vec3(-1, 2, 0.5)), 1e-6f);
  // A quarter of (0, 2, 0.5) and three of (-1, 1, 0.5).
  EXPECT_LT(glm::length(p[2] - glm::vec3(-0.75, 1.25, 0.5)), 1e-6f);
  EXPECT_EQ(scene.meshes()[0].deformation, 1u);
  EXPECT_NEAR(scene.bounds().min.x, -1.0, 1e-6);
  scene.animate(0, 0.0);
  EXPECT_EQ(scene.meshes()[0].positions[3], glm::vec3(1, 2, 0));
}

TEST(GltfAnimation, ASkinIsPosedByItsJointsWithoutAnimationToo) {
  GltfWriter w = strip();
  w.root["nodes"][1]["translation"] = {0, 0, 7};
  w.root["nodes"][0]["weights"] = {1};
  const Loaded loaded = load_glb(w);
  EXPECT_EQ(loaded.scene.meshes()[0].positions[0], glm::vec3(0, 0, 7));
  EXPECT_EQ(loaded.scene.meshes()[0].positions[3], glm::vec3(1, 2, 8));
  EXPECT_TRUE(loaded.scene.rigs().empty());  // nothing moves any more
}

TEST(GltfAnimation, NodesOfOneMeshMoveTheirOwnVertices) {
  GltfWriter w;
  const int positions = w.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, type_float, "VEC3", 3),
            target = w.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}, type_float, "VEC3", 3);
  w.mesh({{{"attributes", {{"POSITION", positions}}}, {"targets", {{{"POSITION", target}}}}}});
  w.root["meshes"][0]["weights"] = {0.5};
  w.node({{"mesh", 0}});
  w.node({{"mesh", 0}, {"weights", {2}}});
  animation(w, "rise", {{0, "weights", {0, 1}, {0, 4}, 1, "STEP"}});
  Loaded loaded = load_glb(w);
  ASSERT_EQ(loaded.scene.meshes().size(), 2u);
  EXPECT_EQ(loaded.scene.meshes()[0].positions[0].z, 0.5f);
  EXPECT_EQ(loaded.scene.meshes()[1].positions[0].z, 2.0f);
  loaded.scene.animate(0, 1.5);
  EXPECT_EQ(loaded.scene.meshes()[0].positions[0].z, 4.0f);
  EXPECT_EQ(loaded.scene.meshes()[1].positions[0].z, 2.0f);
}

TEST(GltfAnimation, AVertexWithoutAFinitePlaceLeavesAllAsItWas) {
  GltfWriter w;
  const int positions = w.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, type_float, "VEC3", 3),
            far = w.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 3e38f}, type_float, "VEC3", 3);
  w.camera();
  w.lights({{{"type", "point"}}});
  w.mesh({{{"attributes", {{"POSITION", positions}}}, {"targets", {{{"POSITION", positions}}}}}});
  w.mesh({{{"attributes", {{"POSITION", positions}}}, {"targets", {{{"POSITION", far}}}}}});
  w.node({{"mesh", 0}});
  w.node({{"mesh", 1}, {"camera", 0}, {"extensions", light_0()}});
  animation(w, "burst",
            {{0, "weights", {0, 1}, {0, 1}, 1}, {1, "weights", {0, 1}, {0, 10}, 1}, {1, "translation", {0, 1}, {0, 0, 0, 0, 0, 5}, 3}});
  Loaded loaded = load_glb(w);
  Scene& scene = loaded.scene;
  scene.animate(0, 0.0);
  EXPECT_THROW(scene.animate(0, 1.0), ks::Error);
  EXPECT_EQ(scene.meshes()[0].positions[1], glm::vec3(1, 0, 0));
  EXPECT_EQ(scene.meshes()[0].deformation, 1u);
  EXPECT_EQ(scene.instances()[1].local_to_world[3].z, 0.0);
  EXPECT_EQ(scene.lights()[0].light_to_world[3].z, 0.0);
  EXPECT_EQ(scene.cameras()[0].camera_to_world[3].z, 0.0);
  scene.animate(0, 0.1);
  EXPECT_EQ(scene.meshes()[0].positions[1], glm::vec3(1.1f, 0, 0));
  EXPECT_EQ(scene.cameras()[0].camera_to_world[3].z, 0.5);
}

TEST(GltfAnimation, AScaleOfZeroHidesForATime) {
  GltfWriter w;
  w.triangle();
  w.node({{"mesh", 0}, {"scale", {0, 0, 0}}});
  animation(w, "show", {{0, "scale", {0, 1}, {0, 0, 0, 1, 1, 1}, 3}});
  Loaded loaded = load_glb(w);
  ASSERT_EQ(loaded.scene.instances().size(), 1u);
  EXPECT_LT(loaded.scene.bounds().max.x, 1e-6);
  loaded.scene.animate(0, 1.0);
  EXPECT_EQ(loaded.scene.bounds().max.x, 1.0);
}

TEST(GltfAnimation, AnimationsOfSecondFilesFollowAndWhatWasRemovedIsPassedOver) {
  GltfWriter w;
  w.thing();
  animation(w, "up", {{0, "translation", {0, 1}, {0, 0, 0, 0, 1, 0}, 3}});
  animation(w, "side", {{0, "translation", {0, 4}, {0, 0, 0, 8, 0, 0}, 3, "LINEAR"}});
  const Folder folder;
  w.write_glb(folder / "a.glb");
  Scene scene;
  for (int i = 0; i < 2; ++i) load_file(scene, folder / "a.glb", glm::dmat4(1.0));
  ASSERT_EQ(scene.rigs().size(), 2u);
  scene.animate(3, 2.0);
  EXPECT_EQ(scene.instances()[0].local_to_world[3], glm::dvec4(0, 0, 0, 1));
  EXPECT_EQ(scene.instances()[1].local_to_world[3], glm::dvec4(4, 0, 0, 1));
  scene.animate(none, 1.0);  // the first of each file counts
  for (int i = 0; i < 2; ++i) EXPECT_EQ(scene.instances()[size_t(i)].local_to_world[3], glm::dvec4(0, 1, 0, 1));
  scene.remove_instance(0);
  scene.animate(none, 0.5);
  EXPECT_EQ(scene.instances()[1].local_to_world[3], glm::dvec4(0, 0.5, 0, 1));
}

TEST(GltfAnimation, BrokenOnesAreErrorsThatNameThem) {
  const auto refused = [](const char* message, auto&& spoil) {
    GltfWriter w = strip();
    animation(w, "bend", {{2, "rotation", {0, 1}, {0, 0, 0, 1, 0, 0, half_turn, half_turn}, 4}});
    spoil(w.root);
    expect_error(w, message);
  };
  refused("skins[0].joints: node 7", [](json& r) { r["skins"][0]["joints"][1] = 7; });
  refused("but its skin has 1", [](json& r) { r["skins"][0]["joints"] = {1}; });
  refused("nodes[0] 'strip'.skin is 1 of 1", [](json& r) { r["nodes"][0]["skin"] = 1; });
  refused("animations[0] 'bend' channels[0].sampler is 3 of 1", [](json& r) { r["animations"][0]["channels"][0]["sampler"] = 3; });
  refused("must be LINEAR, STEP or CUBICSPLINE", [](json& r) { r["animations"][0]["samplers"][0]["interpolation"] = "FAST"; });
  refused("2 keyframes have 8 numbers, must be 24", [](json& r) { r["animations"][0]["samplers"][0]["interpolation"] = "CUBICSPLINE"; });
  refused("animations[0]/channels[0]/target/node", [](json& r) { r["animations"][0]["channels"][0]["target"]["node"] = -1; });
}

TEST(GltfAnimation, WhatIsNotReadGivesAMessage) {
  GltfWriter w = strip();
  animation(w, "colour", {{2, "pointer", {0, 1}, {0, 0, 0, 0, 0, 0}, 3}});
  const Loaded loaded = load_glb(w);
  ASSERT_EQ(loaded.warnings.size(), 2u);
  EXPECT_NE(loaded.warnings[0].find("an animation of 'pointer' is ignored"), std::string::npos) << loaded.warnings[0];
  EXPECT_NE(loaded.warnings[1].find("animation 'colour' moves nothing that is rendered"), std::string::npos) << loaded.warnings[1];
}

}  // namespace
