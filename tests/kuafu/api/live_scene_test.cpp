// SPDX-License-Identifier: Apache-2.0
// Scenes that live: what was changed looks like what was made so, rounds of adding and removing leave memory flat, and what is in use
// stays. Threads with scenes and renderers of their own; the choice of a device.
#include <sys/resource.h>

#include <array>
#include <thread>

#include "kuafu/world.h"
#include "support/heap.h"
#include "support/peak_memory.h"

namespace laws {
namespace {

const kuafu_view_desc view = view_at({0, 0, 0}, 40, 30, 32);
constexpr uint32_t tracers[] = {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE};

void furnish(World& world) {
  world.add(quad({0, 0, 1.5}, {-1, 0, 0}, {0, 1, 0}), lambert(0.6f));
  world.add_point({-0.4, -0.4, 0.3}, 0.4f);
  world.desc().max_bounces = 1;
}

uint32_t add_again(World& world, uint32_t mesh, uint32_t material, const std::array<double, 16>& pose,
                   uint32_t environment = KUAFU_ALL_ENVIRONMENTS, const char* name = "") {
  kuafu_instance_desc d = kuafu_instance_desc_init(mesh);
  d.name = name;
  d.environment = environment;
  d.materials = &material;
  d.material_count = 1;
  std::memcpy(d.local_to_world, pose.data(), sizeof d.local_to_world);
  uint32_t id = 0;
  ok(kuafu_scene_add_instance(world.scene(), &d, &id));
  return id;
}

TEST(LiveScene, ManySmallChangesGiveTheImageOfASceneMadeSo) {
  const std::vector<uint32_t> outputs = {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_DEPTH, KUAFU_OUTPUT_MATERIAL_ID};
  for (const uint32_t tracer : tracers) {
    World changed(tracer), made(tracer);
    furnish(changed);
    const Shape ball = sphere(0.08, 8, true);
    std::vector<uint32_t> ids;
    for (int i = 0; i < 30; ++i) ids.push_back(changed.add(ball, lambert(0.3f), placed({0.05 * i - 0.7, 0.3, 1.2})));
    (void)changed.render({view}, outputs);
    for (int i = 0; i < 30; ++i) {  // a render between, so that each change is followed by itself
      const auto pose = placed({0.05 * i - 0.7, -0.2, 0.9});
      if (i % 3 == 0) ok(kuafu_scene_set_instance_pose(changed.scene(), ids[size_t(i)], pose.data()));
      if (i % 3 == 1) ok(kuafu_scene_remove_instance(changed.scene(), ids[size_t(i)]));
      if (i % 3 == 2) {
        kuafu_material_desc material = lambert(0.9f);
        ok(kuafu_scene_set_material(changed.scene(), uint32_t(i + 2), &material));
      }
      if (i % 5 == 0) (void)changed.render({view}, outputs);
    }
    const uint32_t late = changed.add(ball, lambert(0.5f), placed({0, 0, 0.7}));
    const uint32_t other = 3;
    ok(kuafu_scene_set_instance_materials(changed.scene(), late, &other, 1));

    furnish(made);
    for (int i = 0; i < 30; ++i) {
      const uint32_t id =
          made.add(ball, lambert(i % 3 == 2 ? 0.9f : 0.3f), placed({0.05 * i - 0.7, i % 3 == 0 ? -0.2 : 0.3, i % 3 == 0 ? 0.9 : 1.2}));
      if (i % 3 == 1) ok(kuafu_scene_remove_instance(made.scene(), id));
    }
    const uint32_t same = made.add(ball, lambert(0.5f), placed({0, 0, 0.7}));
    ok(kuafu_scene_set_instance_materials(made.scene(), same, &other, 1));
    auto a = changed.render({view}, outputs), b = made.render({view}, outputs);
    for (const uint32_t output : outputs) {
      uint32_t different = 0;
      for (size_t i = 0; i < a[output].values.size(); ++i) different += std::memcmp(&a[output].values[i], &b[output].values[i], 4) != 0;
      EXPECT_LE(different, 2u) << "tracer " << tracer << ", output " << output;  // edges between triangles may fall to either
    }
  }
}

TEST(LiveScene, AMovedLampIsWhereItIs) {
  World world;
  world.add(quad({0, 0, 1.5}, {-1, 0, 0}, {0, 1, 0}), lambert(0.6f));
  const uint32_t lamp = world.add(quad({0, 0, 0}, {-0.1, 0, 0}, {0, 0.1, 0}), emitter(5), placed({0, 0, 0.2}));
  world.add(sphere(0.05, 6, true), lambert(0.5f), placed({0.4, 0, 1.0}));
  world.desc().samples_per_pixel = 64;
  const double near_lamp = world.radiance(view).mean();
  const auto away = placed({0, 0, 30});
  ok(kuafu_scene_set_instance_pose(world.scene(), lamp, away.data()));
  EXPECT_LT(world.radiance(view).mean(), 1e-3 * near_lamp);
  const auto back = placed({0, 0, 0.2});
  ok(kuafu_scene_set_instance_pose(world.scene(), lamp, back.data()));
  EXPECT_NEAR(world.radiance(view).mean(), near_lamp, 1e-6 * near_lamp);
  ok(kuafu_scene_remove_instance(world.scene(), lamp));
  EXPECT_EQ(world.radiance(view).mean(), 0.0);
}

double resident_mib() { return ks_test::status_bytes("VmRSS") / (1 << 20); }

/// What the heap has given out. Resident pages cannot tell a small leak: freed pieces keep theirs, more or fewer of them in each run.
double heap_mib() { return double(ks::test::heap_bytes()) / (1 << 20); }

// A mesh and a texture left behind in every round would be 100 MiB, entries of tables 0.9 MiB; four bytes for each id are 6 kB.
#if defined(__SANITIZE_ADDRESS__)
constexpr double most_resident_growth_mib = 512;  // the sanitizer keeps what is freed for a while
#else
constexpr double most_resident_growth_mib = 64;
#endif
constexpr double most_heap_growth_mib = 0.5;

uint64_t allocated_bytes() {
  uint64_t bytes = 0;
  ok(kuafu_device_allocated_bytes(shared_device(), &bytes));
  return bytes;
}

uint32_t add_texture(kuafu_scene scene, uint32_t size, uint8_t value = 200) {
  const std::vector<uint8_t> texels(size_t(size) * size, value);
  const kuafu_texture_desc texture = texture_of(texels, size);
  uint32_t id = 0;
  ok(kuafu_scene_add_texture(scene, &texture, &id));
  return id;
}

/// A quad with `texture` in front of the view.
void add_textured(World& world, uint32_t texture) {
  Shape shape = quad({0, 0, 1}, {-0.3, 0, 0}, {0, 0.3, 0});
  shape.uvs = {0, 0, 1, 0, 1, 1, 0, 1};
  kuafu_material_desc m = lambert(0.8f);
  m.base_color_texture = texture;
  world.add(shape, m);
}

// The first of two new textures is there already when memory for the second is refused.
TEST(LiveScene, ARenderThatRunsOutOfMemoryLeavesNothingHalfDone) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's shadow memory leaves no sense in a limit of the address space";
#endif
  constexpr uint32_t large = 6144;  // 302 MB as texels of the stages
  World world, made;
  for (World* w : {&world, &made}) furnish(*w);
  (void)world.radiance(view);
  add_textured(world, add_texture(world.scene(), 16));
  (void)add_texture(world.scene(), large);

  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_AS, &before), 0);
  const rlimit tight{rlim_t(ks_test::status_bytes("VmSize")) + (128u << 20), before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_AS, &tight), 0);
  const ks_status rendered = world.status_of(view);
  ASSERT_EQ(setrlimit(RLIMIT_AS, &before), 0);
  EXPECT_TRUE(rendered == KS_ERROR_OUT_OF_HOST_MEMORY || rendered == KS_ERROR_OUT_OF_DEVICE_MEMORY) << rendered;

  add_textured(made, add_texture(made.scene(), 16));
  EXPECT_EQ(world.radiance(view).values, made.radiance(view).values);
}

/// Adds one of each, renders, and removes them: 60 kB of vertices, 260 kB of texels, and a MB of each name.
void round_of_all(World& world, const Shape& shape, int round) {
  static const std::string long_name(1 << 20, 'x');
  kuafu_scene scene = world.scene();
  kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
  mesh.positions = shape.positions.data();
  mesh.indices = shape.indices.data();
  mesh.vertex_count = uint32_t(shape.positions.size() / 3);
  mesh.triangle_count = uint32_t(shape.indices.size() / 3);
  uint32_t mesh_id = 0, material_id = 0;
  ok(kuafu_scene_add_mesh(scene, &mesh, &mesh_id));
  kuafu_material_desc material = lambert(0.5f);
  material.base_color_texture = add_texture(scene, 512);
  ok(kuafu_scene_add_material(scene, &material, &material_id));
  const uint32_t instance =
      add_again(world, mesh_id, material_id, placed({0.1 * (round % 7) - 0.3, 0, 1.0}), KUAFU_ALL_ENVIRONMENTS, long_name.c_str());
  kuafu_light_desc lamp = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
  lamp.name = long_name.c_str();
  const uint32_t light = world.add_light(lamp, placed({0, -0.3, 0.3}));
  (void)world.radiance(view);
  ok(kuafu_scene_remove_instance(scene, instance));
  ok(kuafu_scene_remove_light(scene, light));
  ok(kuafu_scene_remove_material(scene, material_id));
  ok(kuafu_scene_remove_texture(scene, material.base_color_texture));
  ok(kuafu_scene_remove_mesh(scene, mesh_id));
}

class LiveMemory : public testing::TestWithParam<uint32_t> {};
INSTANTIATE_TEST_SUITE_P(Tracers, LiveMemory, testing::ValuesIn(tracers),
                         [](const auto& info) { return std::string(info.param == KUAFU_TRACER_AUTO ? "Auto" : "Compute"); });

TEST_P(LiveMemory, ManyRoundsOfAddRenderRemoveLeaveItFlat) {
  World world(GetParam());
  furnish(world);
  world.desc().samples_per_pixel = 1;
  const Shape ball = sphere(0.1, 40, false);
  const kuafu_view_desc small = view_at({0, 0, 0}, 8, 8, 8);
  for (int round = 0; round < 20; ++round) round_of_all(world, ball, round);
  (void)world.render({small}, {KUAFU_OUTPUT_RADIANCE});
  const double resident = resident_mib(), heap = heap_mib();
  const uint64_t allocated = allocated_bytes();
  for (int round = 0; round < 60; ++round) round_of_all(world, ball, round);  // what one leaves behind exceeds the limit by far
  (void)world.render({small}, {KUAFU_OUTPUT_RADIANCE});                       // the device learns of the last removal
  EXPECT_LT(heap_mib() - heap, most_heap_growth_mib);
  EXPECT_LT(resident_mib() - resident, most_resident_growth_mib);
  EXPECT_EQ(allocated_bytes(), allocated);
  kuafu_scene_summary summary = kuafu_scene_summary_init();
  ok(kuafu_scene_get_summary(world.scene(), &summary));
  EXPECT_EQ(summary.mesh_count, 1u);
  EXPECT_EQ(summary.material_count, 1u);
  EXPECT_EQ(summary.texture_count, 0u);
  EXPECT_EQ(summary.instance_count, 1u);
  EXPECT_EQ(summary.light_count, 1u);
}

// No render sees the scene between the removal and what takes the slots.
TEST_P(LiveMemory, WhatTakesASlotOfAnotherLooksAsIfMadeAnew) {
  World world(GetParam()), made(GetParam());
  for (World* w : {&world, &made}) furnish(*w);
  const auto add = [](World& to, const Shape& shape, uint8_t value, float brightness) {
    kuafu_material_desc material = lambert(brightness);
    material.base_color_texture = add_texture(to.scene(), value, value);
    return std::array{to.add(shape, material, placed({0, 0, 1})), to.add_point({0, -0.3, 0.3}, brightness), material.base_color_texture};
  };
  const auto [instance, light, texture] = add(world, sphere(0.1, 10, false), 16, 0.2f);
  (void)world.radiance(view);
  kuafu_scene scene = world.scene();
  ok(kuafu_scene_remove_instance(scene, instance));
  ok(kuafu_scene_remove_light(scene, light));
  ok(kuafu_scene_remove_material(scene, instance));
  ok(kuafu_scene_remove_texture(scene, texture));
  ok(kuafu_scene_remove_mesh(scene, instance));
  for (World* w : {&world, &made}) add(*w, quad({0, 0, 0}, {-0.2, 0, 0}, {0, 0.2, 0}), 90, 0.7f);
  EXPECT_EQ(world.radiance(view).values, made.radiance(view).values);
}

TEST(LiveScene, EnvironmentsShareTheirMeshes) {
  const Shape ball = sphere(0.1, 60, true);  // 14 k triangles
  std::vector<uint64_t> bytes;
  for (const uint32_t environments : {1u, 64u}) {
    const uint64_t before = allocated_bytes();
    World world;
    furnish(world);
    world.desc().samples_per_pixel = 1;
    EXPECT_EQ(world.add(ball, lambert(0.5f), placed({0, 0, 1}), 0), 2u);
    std::vector<kuafu_view_desc> views(environments, view_at({0, 0, 0}, 8, 8, 8));
    for (uint32_t e = 0; e < environments; ++e) {
      views[e].environment = e;
      if (e > 0) add_again(world, 2, 2, placed({0, 0.1, 1}), e);
    }
    (void)world.render(views, {KUAFU_OUTPUT_RADIANCE});
    bytes.push_back(allocated_bytes() - before);
  }
  const uint64_t of_mesh = ball.positions.size() * 8 + ball.indices.size() * 4;
  EXPECT_LT(bytes[1] - bytes[0], 10 * of_mesh) << "64 environments, one mesh of " << of_mesh << " bytes";
}

TEST(LiveScene, WhatIsUsedCannotBeRemovedAndTheErrorNamesTheUser) {
  World world;
  kuafu_scene scene = world.scene();
  const auto refused = [](ks_status status, const std::vector<const char*>& parts) {
    EXPECT_EQ(status, KS_ERROR_INVALID_ARGUMENT);
    const std::string message = kuafu_last_error();
    for (const char* part : parts) EXPECT_NE(message.find(part), std::string::npos) << message;
  };
  const uint32_t texture = add_texture(scene, 4);
  kuafu_material_desc material = lambert(0.5f);
  material.normal_texture = texture;
  material.name = "brick";
  const uint32_t instance = world.add(sphere(0.1, 4, false), material);
  refused(kuafu_scene_remove_mesh(scene, 1), {"mesh 1", "instance 1"});
  refused(kuafu_scene_remove_material(scene, 1), {"material 1 'brick'", "instance 1"});
  refused(kuafu_scene_remove_texture(scene, texture), {"texture 1", "material 1 'brick'"});
  ok(kuafu_scene_remove_instance(scene, instance));
  ok(kuafu_scene_remove_material(scene, 1));
  kuafu_environment_desc environment = kuafu_environment_desc_init();
  environment.texture = texture;
  ok(kuafu_scene_set_environment(scene, &environment));
  refused(kuafu_scene_remove_texture(scene, texture), {"environment"});
  environment.texture = 0;
  ok(kuafu_scene_set_environment(scene, &environment));
  ok(kuafu_scene_remove_texture(scene, texture));
  ok(kuafu_scene_remove_mesh(scene, 1));
  for (const auto& remove : {kuafu_scene_remove_mesh, kuafu_scene_remove_texture, kuafu_scene_remove_material}) {
    refused(remove(scene, 1), {"was removed"});
    for (const uint32_t id : {0u, 2u}) refused(remove(scene, id), {"there is no"});
  }
  kuafu_instance_desc ghost = kuafu_instance_desc_init(1);
  uint32_t id = 0;
  refused(kuafu_scene_add_instance(scene, &ghost, &id), {"mesh 1 was removed"});
  refused(kuafu_scene_add_material(scene, &material, &id), {"texture 1 was removed"});
  refused(kuafu_scene_set_material(scene, 1, &material), {"material 1 was removed"});
  EXPECT_EQ(kuafu_scene_material_name(scene, 1), nullptr);
}

TEST(LiveScene, ScenesAndRenderersInThreadsGiveWhatTheyGiveAlone) {
  const auto image_of = [](int which) {
    World world(which % 2 ? KUAFU_TRACER_AUTO : KUAFU_TRACER_COMPUTE);
    furnish(world);
    world.add(sphere(0.1 + 0.02 * which, 10, true), lambert(0.4f), placed({0.1 * which, 0, 1}));
    world.desc().samples_per_pixel = 2;
    Pixels last;
    for (int frame = 0; frame < 3; ++frame) last = world.radiance(view);
    return last.values;
  };
  (void)shared_device();
  std::vector<std::vector<float>> alone, together(4);
  for (int i = 0; i < 4; ++i) alone.push_back(image_of(i));
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) threads.emplace_back([&, i] { together[size_t(i)] = image_of(i); });
  for (std::thread& t : threads) t.join();
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(alone[i], together[i]) << i;
}

}  // namespace
}  // namespace laws
