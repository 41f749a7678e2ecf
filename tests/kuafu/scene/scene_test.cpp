// SPDX-License-Identifier: Apache-2.0
// Scene: what is refused, ids, append.
#include "scene/scene.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "capi/device/expect_error.h"

namespace {

using namespace kuafu;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

Mesh triangle() {
  Mesh mesh;
  mesh.name = "triangle";
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.indices = {{0, 1, 2}};
  return mesh;
}

template <class F>
void expect_refused(F&& call, const std::string& part) {
  EXPECT_ERROR(call(), KS_ERROR_INVALID_ARGUMENT, part);
}

template <class T, class F>
void expect_refused(T value, F&& spoil, uint32_t (Scene::*add)(T), const std::string& part) {
  Scene scene;
  spoil(value);
  expect_refused([&] { (scene.*add)(value); }, part);
}

TEST(Scene, RefusesMeshesThatDoNotFitTogether) {
  const auto refuse = [](auto spoil, const std::string& part) { expect_refused(triangle(), spoil, &Scene::add_mesh, part); };
  refuse([](Mesh& m) { m.positions.clear(); }, "no vertices");
  refuse([](Mesh& m) { m.indices.clear(); }, "no triangles");
  refuse([](Mesh& m) { m.positions[1].y = nan; }, "position 1 is not finite");
  refuse([](Mesh& m) { m.indices[0].z = 3; }, "uses vertex 3, but there are 3");
  refuse([](Mesh& m) { m.normals = {{0, 0, 1}}; }, "1 normals for 3 vertices");
  refuse([](Mesh& m) { m.normals.assign(3, {0, 0, 2}); }, "normal 0 has length 2");
  refuse([](Mesh& m) { m.uvs.assign(3, {0, INFINITY}); }, "uv 0 is not finite");
  refuse([](Mesh& m) { m.slots = {0, 1}; }, "2 slots for 1 triangles");
}

TEST(Scene, RefusesTexturesWhoseBytesAreNotTheirSize) {
  const Texture good{.name = "t", .width = 2, .height = 2, .channels = 3, .texels = std::vector<uint8_t>(12)};
  const auto refuse = [&](auto spoil, const std::string& part) { expect_refused(good, spoil, &Scene::add_texture, part); };
  refuse([](Texture& t) { t.texels.pop_back(); }, "11 bytes");
  refuse([](Texture& t) { t.width = 0; }, "size is 0x2");
  refuse([](Texture& t) { t.channels = 5; }, "5 channels");
  refuse([](Texture& t) { t.format = Texture::Format::f32, t.texels.assign(48, 0xff); }, "value 0 is not finite");
  Scene scene;
  EXPECT_EQ(scene.add_texture(good), 0u);
}

TEST(Scene, RefusesMaterialsOutOfRange) {
  const auto refuse = [](auto spoil, const std::string& part) { expect_refused(Material{}, spoil, &Scene::add_material, part); };
  refuse([](Material& m) { m.base_color.g = 1.5f; }, "base_color is 1.5");
  refuse([](Material& m) { m.roughness = -0.1f; }, "roughness is -0.1");
  refuse([](Material& m) { m.metallic = nan; }, "metallic");
  refuse([](Material& m) { m.ior = 0.9f; }, "ior is 0.9");
  refuse([](Material& m) { m.emission.r = INFINITY; }, "emission is inf");
  refuse([](Material& m) { m.ir_albedo = 1.01f; }, "ir_albedo is 1.01");
  refuse([](Material& m) { m.normal_texture = 0; }, "there is no texture 1");
}

TEST(Scene, RefusesLightsAndPosesThatAreNoRotation) {
  const auto refuse = [](auto spoil, const std::string& part) { expect_refused(Light{}, spoil, &Scene::add_light, part); };
  refuse([](Light& l) { l.intensity.r = -1; }, "intensity is -1");
  refuse([](Light& l) { l.light_to_world[0][0] = 1.1; }, "is not a rotation and translation");
  refuse([](Light& l) { l.light_to_world[0][0] = -1; }, "determinant -1");
  refuse([](Light& l) { l.light_to_world[3][1] = NAN; }, "not finite");
  refuse([](Light& l) { l.texture = 0; }, "there is no texture");
  refuse([](Light& l) { l.texture = 0, l.radius_m = 1; }, "takes no texture");
  refuse([](Light& l) { l.kind = Light::Kind::disk; }, "radius_m is 0");
  refuse([](Light& l) { l.kind = Light::Kind::projector; }, "there is no texture");
  refuse([](Light& l) { l.kind = Light::Kind::projector, l.k[0][0] = 0; }, "focal lengths of K are 0");
  Scene scene;
  scene.add_mesh(triangle());
  Instance instance{.name = "i", .mesh = 0};
  instance.local_to_world[1][3] = 0.5;
  expect_refused([&] { scene.add_instance(instance); }, "last row 0 0.5 0 1");
  instance.local_to_world = glm::dmat4(1.0);
  instance.local_to_world[2] = instance.local_to_world[1];
  expect_refused([&] { scene.add_instance(instance); }, "not invertible");
  instance.local_to_world = glm::dmat4(1e-19);
  instance.local_to_world[3][3] = 1.0;
  expect_refused([&] { scene.add_instance(instance); }, "scales axis 0 by 1e-19");
  instance.local_to_world = glm::dmat4(1.0);
  instance.local_to_world[3][0] = 1e13;
  expect_refused([&] { scene.add_instance(instance); }, "moves by 1e+13 m");
  expect_refused([&] { scene.add_instance({.name = "i", .mesh = 1}); }, "there is no mesh 2 (the scene has 1)");
  expect_refused([&] { scene.add_instance({.name = "i", .mesh = 0, .materials = {2}}); }, "materials[0] is 3");
}

TEST(Scene, SlotsOfRemovedObjectsAreTheNextOnes) {
  Scene scene;
  const auto add = [&scene](int which) {
    const std::array<uint32_t, 5> ids = {scene.add_mesh(triangle()),
                                         scene.add_texture({.width = 1, .height = 1, .channels = 1, .texels = {7}}), scene.add_material({}),
                                         scene.add_instance({.mesh = uint32_t(which)}), scene.add_light({})};
    EXPECT_EQ(ids, (std::array<uint32_t, 5>{uint32_t(which), uint32_t(which), uint32_t(which), uint32_t(which), uint32_t(which)}));
  };
  add(0);
  for (uint32_t id = 1; id < 100; ++id) {
    add(int(id));
    scene.remove_instance(id), scene.remove_mesh(id), scene.remove_texture(id), scene.remove_material(id), scene.remove_light(id);
    expect_refused([&] { scene.set_texture(id, {.width = 1, .height = 1, .channels = 1, .texels = {7}}); }, "was removed");
    expect_refused([&] { scene.add_instance({.mesh = id}); }, "was removed");
    expect_refused([&] { scene.set_light(id, {}); }, "was removed");
  }
  expect_refused([&] { scene.remove_light(107); }, "there is no light 108");
  add(100);
  const std::vector<uint32_t> first_and_last{0, 100};
  EXPECT_EQ(scene.meshes().ids(), first_and_last);
  EXPECT_EQ(scene.textures().ids(), first_and_last);
  EXPECT_EQ(scene.materials().ids(), first_and_last);
  EXPECT_EQ(scene.instances().ids(), first_and_last);
  EXPECT_EQ(scene.lights().ids(), first_and_last);
  Scene whole;
  whole.add_mesh(triangle());
  whole.append(std::move(scene));
  EXPECT_EQ(whole.meshes().ids(), (std::vector<uint32_t>{0, 1, 101}));
  EXPECT_EQ(whole.instances()[100].mesh, 101u);
  expect_refused([&] { whole.remove_mesh(2); }, "was removed");
}

TEST(Scene, RevisionsGrowWithWhatChangedOnly) {
  Scene scene;
  scene.add_mesh(triangle());
  scene.add_instance({.mesh = 0});
  const Revisions before = scene.revisions();
  scene.set_instance_pose(0, glm::dmat4(1.0));
  EXPECT_GT(scene.revisions().instances, before.instances);
  EXPECT_EQ(scene.revisions().meshes, before.meshes);
  EXPECT_EQ(scene.revisions().lights, before.lights);
  const uint64_t refused = scene.revisions().materials;
  expect_refused([&] { scene.set_material(0, {}); }, "there is no material 1");
  EXPECT_EQ(scene.revisions().materials, refused);
}

TEST(Scene, UpdatedMeshCountsItsDeformationsAndNothingElseChanges) {
  Scene scene;
  const uint32_t moved = scene.add_mesh(triangle()), still = scene.add_mesh(triangle());
  const Revisions before = scene.revisions();
  scene.update_mesh_positions(moved, {{0, 0, 1}, {1, 0, 1}, {0, 2, 1}}, {});
  EXPECT_EQ(scene.meshes()[moved].positions[2], glm::vec3(0, 2, 1));
  EXPECT_EQ(scene.meshes()[moved].deformation, 1u);
  EXPECT_EQ(scene.meshes()[still].deformation, 0u);
  EXPECT_GT(scene.revisions().meshes, before.meshes);
  EXPECT_EQ(scene.revisions().instances, before.instances);
  expect_refused([&] { scene.update_mesh_positions(moved, {{0, 0, 1}}, {}); }, "1 positions for its 3 vertices");
  expect_refused([&] { scene.update_mesh_positions(moved, triangle().positions, {{0, 0, 1}}); }, "1 normals, it was made with 0");
  EXPECT_EQ(scene.meshes()[moved].deformation, 1u) << "a refused update changes nothing";
}

TEST(Scene, AppendShiftsEveryIdAndKeepsNone) {
  const auto make = [] {
    Scene scene;
    scene.add_texture({.width = 1, .height = 1, .channels = 1, .texels = {7}});
    scene.add_material({{.base_color_texture = 0}});
    scene.add_mesh(triangle());
    scene.add_instance({.mesh = 0, .materials = {0, none}});
    scene.add_light({{.kind = Light::Kind::projector, .texture = 0}});
    scene.add_light({});
    return scene;
  };
  Scene scene = make();
  scene.append(make());
  ASSERT_EQ(scene.instances().size(), 2u);
  EXPECT_EQ(scene.instances()[1].mesh, 1u);
  EXPECT_EQ(scene.instances()[1].materials, (std::vector<uint32_t>{1, none}));
  EXPECT_EQ(scene.materials()[1].base_color_texture, 1u);
  EXPECT_EQ(scene.materials()[1].normal_texture, none);
  EXPECT_EQ(scene.lights()[2].texture, 1u);
  EXPECT_EQ(scene.lights()[3].texture, none);
  EXPECT_EQ(scene.materials()[0].base_color_texture, 0u);
}

TEST(Scene, BoundsAreTightAroundTurnedInstances) {
  Scene scene;
  scene.add_mesh(triangle());
  glm::dmat4 quarter_turn(0.0);  // about z: x to y, y to -x
  quarter_turn[0][1] = 1, quarter_turn[1][0] = -1, quarter_turn[2][2] = 1;
  quarter_turn[3] = {10, 0, 5, 1};
  scene.add_instance({.mesh = 0, .local_to_world = quarter_turn});
  const Bounds bounds = scene.bounds();
  EXPECT_EQ(bounds.min, glm::dvec3(9, 0, 5));
  EXPECT_EQ(bounds.max, glm::dvec3(10, 1, 5));
}

}  // namespace
