// SPDX-License-Identifier: Apache-2.0
// Instances and lights that move or switch while the shutter is open: closed forms, relativity, and tracers that agree.
#include "kuafu/world.h"

namespace laws {
namespace {

using Pose = std::array<double, 16>;

void set_velocity(World& world, uint32_t instance, const Vec3& linear, const Vec3& angular = {0, 0, 0}) {
  ok(kuafu_scene_set_instance_velocity(world.scene(), instance, &linear.x, &angular.x));
}

kuafu_view_desc rolling(uint32_t width, uint32_t height, double line_time_s, double exposure_s = 0) {
  kuafu_view_desc view = view_at({0, 0, 0}, width, height, 100);
  view.camera.shutter = KUAFU_SHUTTER_ROLLING;
  view.camera.line_time_s = line_time_s;
  view.camera.exposure_s = exposure_s;
  return view;
}

/// A half plane's edge that moves by 3 m/s, seen at 2 m by lines 1 ms apart: 0.15 pixels a line. Its frame is turned and scaled.
TEST(Motion, rolling_shutter_shears_a_moving_bar) {
  World world;
  Pose pose = placed({0.05, 0, 2}, pi, 2);
  const uint32_t bar = world.add(quad({25, 0, 0}, {25, 0, 0}, {0, -25, 0}), emitter(1.0f), pose);
  set_velocity(world, bar, {-3, 0, 0});  // own x looks along -x of the world
  const Pixels image = world.radiance(rolling(40, 36, 1e-3), 64);
  for (uint32_t row = 0; row < 36; ++row) {
    double sum = 0;
    for (uint32_t c = 0; c < 40; ++c) sum += image.at(0, row, c);
    EXPECT_NEAR(sum - 20, 100 * (0.05 + 3e-3 * (row - 17.5)) / 2, 0.03) << "row " << row;
  }
}

/// Normals and depths of a plate that turns about the y axis, by its angle at each row's time.
TEST(Motion, aovs_are_those_of_the_row_s_time) {
  World world;
  const uint32_t plate = world.add(quad({0, 0, 0}, {-3, 0, 0}, {0, 3, 0}), lambert(0.5f), placed({0, 0, 2}));
  set_velocity(world, plate, {0, 0, 0.5}, {0, 10, 0});
  auto images = world.render({rolling(8, 21, 1e-2)}, {KUAFU_OUTPUT_NORMAL, KUAFU_OUTPUT_DEPTH});
  for (uint32_t row = 0; row < 21; ++row) {
    const double angle = 0.1 * (row - 10.0), s = std::sin(angle), c = std::cos(angle);
    EXPECT_NEAR(images[KUAFU_OUTPUT_NORMAL].at(0, row, 3, 0), -s, 2e-6) << row;
    EXPECT_NEAR(images[KUAFU_OUTPUT_NORMAL].at(0, row, 3, 2), -c, 2e-6) << row;
    // The plate's origin goes along its own z, which turns: a circle of radius v / w.
    const double x = 0.05 * (1 - c), z = 2 + 0.05 * s, ray = (3 - 3.5) / 100;
    EXPECT_NEAR(images[KUAFU_OUTPUT_DEPTH].at(0, row, 3), (x * s + z * c) / (ray * s + c), 1e-5) << row;
  }
}

/// Twist of an object in its own frame that is `-twist` of the camera at the origin: v' = -R^T (v + w x p), w' = -R^T w.
std::pair<Vec3, Vec3> opposite(const Pose& pose, const Vec3& v, const Vec3& w) {
  const glm::dmat3 back(pose[0], pose[1], pose[2], pose[4], pose[5], pose[6], pose[8], pose[9], pose[10]);
  return {-(back * (v + glm::cross(w, Vec3(pose[3], pose[7], pose[11])))), -(back * w)};
}

/// A room of diffuse, glossy and clear things under a projector, a lamp of some size and a shining plate; all move as asked.
void furnish(World& world, const Vec3& v, const Vec3& w) {
  const auto add = [&](const Shape& shape, const kuafu_material_desc& material, const Pose& pose) {
    const auto [linear, angular] = opposite(pose, v, w);
    set_velocity(world, world.add(shape, material, pose), linear, angular);
  };
  add(quad({0, 0, 0}, {-2, 0, 0}, {0, 2, 0}), lambert(0.6f), placed({0, 0, 1.3}, 0.1));
  add(quad({0, 0, 0}, {-1, 0, 0}, {0, 0, -0.6}), lambert(0.7f), placed({0, 0.3, 0.8}));
  add(sphere(0.13, 12, true), metal(0.3f), placed({-0.22, 0.15, 0.85}, 0.7));
  add(sphere(0.12, 12, true), glass(1.5f), placed({0.24, 0.15, 0.75}));
  add(quad({0, 0, 0}, {-0.1, 0, 0}, {0, 0.1, 0}), emitter(1.0f), placed({0.4, -0.3, 1.0}, 0.5));
  const auto add_light = [&](kuafu_light_desc light, const Pose& pose) {
    const auto [linear, angular] = opposite(pose, v, w);
    std::copy_n(&linear.x, 3, light.linear_velocity);
    std::copy_n(&angular.x, 3, light.angular_velocity);
    return world.add_light(light, pose);
  };
  add_light(light_of(KUAFU_LIGHT_POINT, 0.2f, 0.03), placed({-0.4, -0.4, 0.3}));
  add_light(world.projector(dotted(32 * 32), 32, 32, 25, 1.0f), placed({0.05, 0, 0}, 0.05));
}

const Vec3 v{0.5, -0.3, 0.8}, w{0.9, -1.2, 2.0};
const std::vector<uint32_t> outputs{KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_PROJECTOR_DIRECT, KUAFU_OUTPUT_DEPTH};

std::map<uint32_t, Pixels> moving_camera(uint32_t tracer, uint32_t max_bounces) {
  World world(tracer);
  furnish(world, {0, 0, 0}, {0, 0, 0});
  world.take(16, max_bounces);
  kuafu_view_desc view = rolling(40, 24, 3e-3, 8e-3);
  std::copy_n(&v.x, 3, view.camera.linear_velocity);
  std::copy_n(&w.x, 3, view.camera.angular_velocity);
  return world.render({view}, outputs);
}

std::map<uint32_t, Pixels> moving_world(uint32_t tracer, uint32_t max_bounces) {
  World world(tracer);
  furnish(world, v, w);
  world.take(16, max_bounces);
  return world.render({rolling(40, 24, 3e-3, 8e-3)}, outputs);
}

/// Same samples on both sides: what needs no direction around a normal agrees path by path, the rest of the direct light in its mean.
TEST(Motion, a_camera_in_motion_sees_what_one_at_rest_sees_of_a_moving_world) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) {
    auto camera = moving_camera(tracer, 0), world = moving_world(tracer, 0);
    EXPECT_LT(relative_difference(camera[KUAFU_OUTPUT_DEPTH], world[KUAFU_OUTPUT_DEPTH]), 1e-4) << tracer;
    EXPECT_LT(relative_difference(camera[KUAFU_OUTPUT_PROJECTOR_DIRECT], world[KUAFU_OUTPUT_PROJECTOR_DIRECT]), 2e-3) << tracer;
    EXPECT_NEAR(camera[KUAFU_OUTPUT_RADIANCE].mean() / world[KUAFU_OUTPUT_RADIANCE].mean(), 1, 0.01) << tracer;
  }
}

TEST(Motion, tracers_agree_on_a_moving_world) {
  SKIP_IF(why_not(KUAFU_TRACER_EMBREE));
  auto embree = moving_world(KUAFU_TRACER_EMBREE, 3), compute = moving_world(KUAFU_TRACER_COMPUTE, 3);
  EXPECT_LT(relative_difference(embree[KUAFU_OUTPUT_DEPTH], compute[KUAFU_OUTPUT_DEPTH]), 1e-4);
  EXPECT_LT(relative_difference(embree[KUAFU_OUTPUT_RADIANCE], compute[KUAFU_OUTPUT_RADIANCE]), 5e-3);
}

TEST(Motion, rt_pipelines_follow_cameras_and_refuse_instances) {
  SKIP_IF(why_not(KUAFU_TRACER_RT_PIPELINE));
  auto pipeline = moving_camera(KUAFU_TRACER_RT_PIPELINE, 3), compute = moving_camera(KUAFU_TRACER_COMPUTE, 3);
  EXPECT_LT(relative_difference(pipeline[KUAFU_OUTPUT_RADIANCE], compute[KUAFU_OUTPUT_RADIANCE]), 5e-3);
  World world(KUAFU_TRACER_RT_PIPELINE);
  set_velocity(world, world.add(quad({0, 0, 2}, {-1, 0, 0}, {0, 1, 0}), lambert(0.5f)), {1, 0, 0});
  expect_refused(world.status_of(rolling(8, 8, 1e-3)), "KUAFU_TRACER_COMPUTE", KS_ERROR_UNSUPPORTED);
}

TEST(Motion, what_moves_gives_the_same_bits_for_any_thread_count) {
  std::vector<std::vector<float>> images;
  for (const uint32_t workers : {1u, 3u}) {
    World world(KUAFU_TRACER_AUTO, workers);
    furnish(world, v, w);
    images.push_back(world.radiance(rolling(24, 18, 2e-3, 8e-3)).values);
  }
  EXPECT_EQ(images[0], images[1]);
}

TEST(Motion, an_instant_sees_nothing_of_it) {
  World still, moving;
  furnish(still, {0, 0, 0}, {0, 0, 0});
  furnish(moving, v, w);
  const kuafu_view_desc view = view_at({0, 0, 0}, 24, 18, 50);
  EXPECT_EQ(still.radiance(view).values, moving.radiance(view).values);
}

TEST(Motion, velocities_and_shutters_change_between_frames) {
  World world;
  const uint32_t bar = world.add(quad({-50, 0, 2}, {-50, 0, 0}, {0, 50, 0}), emitter(1.0f));
  world.desc().samples_per_pixel = 64;
  kuafu_view_desc view = view_at({0, 0, 0}, 40, 4, 100);
  const std::vector<float> still = world.radiance(view).values;
  view.camera.exposure_s = 0.01;
  const std::vector<float> exposed = world.radiance(view).values;
  EXPECT_EQ(still, exposed);
  set_velocity(world, bar, {20, 0, 0});
  const Pixels blurred = world.radiance(view);
  EXPECT_NEAR(blurred.at(0, 2, 19), 0.55, 0.05);
  view.camera.exposure_s = 0.02;
  EXPECT_NEAR(world.radiance(view).at(0, 2, 11), 0.5 + 8.5 / 20, 0.05);
  view.camera.exposure_s = 0;
  EXPECT_EQ(world.radiance(view).values, still);
  set_velocity(world, bar, {0, 0, 0});
  view.camera.exposure_s = 0.01;
  EXPECT_EQ(world.radiance(view).values, still);
}

/// A wall under a projector that is on for a part of the exposure gets that part of its light.
class Window : public testing::Test {
 protected:
  Window() { world_.add(quad({0, 0, 2}, {-5, 0, 0}, {0, 5, 0}), lambert(0.5f)); }
  Pixels image(const kuafu_view_desc& view, double from_s, double until_s) {
    light_.on_from_s = from_s, light_.on_until_s = until_s;
    ok(kuafu_scene_set_light(world_.scene(), id_, &light_));
    return world_.radiance(view, 256, 0);
  }
  World world_;
  kuafu_light_desc light_ = world_.projector(std::vector<float>(16, 1.0f), 4, 4, 2, 1.0f);
  uint32_t id_ = world_.add_light(light_, placed({0, 0, 0}));
};

TEST_F(Window, a_projector_shines_within_it) {
  kuafu_view_desc view = view_at({0, 0, 0}, 8, 8, 100);
  view.camera.exposure_s = 0.01;
  const auto mean = [&](double from_s, double until_s) { return image(view, from_s, until_s).mean(); };
  const double always = mean(0, 0);
  EXPECT_GT(always, 0);
  EXPECT_NEAR(mean(-0.005, 0.006), always, 1e-4 * always);
  EXPECT_NEAR(mean(0.001, 0.0035), 0.25 * always, 0.01 * always);
  EXPECT_NEAR(mean(-1, 0), 0.5 * always, 0.01 * always);
  EXPECT_EQ(mean(0.006, 1), 0);
  EXPECT_EQ(mean(-1, -0.005), 0);
  view.camera.exposure_s = 0;
  EXPECT_NEAR(mean(-0.001, 0.001), always, 1e-4 * always);
  EXPECT_EQ(mean(0.001, 0.002), 0);
}

TEST_F(Window, rows_are_lit_while_it_is_open) {
  const kuafu_view_desc view = rolling(4, 20, 1e-3, 4e-3);
  const Pixels always = image(view, 0, 0), part = image(view, -3e-3, 4e-3);
  for (uint32_t row = 0; row < 20; ++row) {
    const double middle = 1e-3 * (row - 9.5), open = std::min(4e-3, middle + 2e-3) - std::max(-3e-3, middle - 2e-3);
    EXPECT_NEAR(part.at(0, row, 2) / always.at(0, row, 2), std::max(0.0, open) / 4e-3, 0.02) << "row " << row;
  }
}

TEST(Motion, what_cannot_be_is_refused_with_the_numbers) {
  World world;
  const uint32_t id = world.add(quad({0, 0, 2}, {-5, 0, 0}, {0, 5, 0}), lambert(0.5f));
  const Vec3 zero{}, nan{0, NAN, 0};
  expect_refused(kuafu_scene_set_instance_velocity(world.scene(), id, &nan.x, &zero.x), "linear_velocity is nan");
  expect_refused(kuafu_scene_set_instance_velocity(world.scene(), id, &zero.x, nullptr), "angular is NULL");
  expect_refused(kuafu_scene_set_instance_velocity(world.scene(), 7, &zero.x, &zero.x), "no instance 7");
  kuafu_light_desc light = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
  uint32_t light_id = 0;
  light.on_from_s = 1;
  expect_refused(kuafu_scene_add_light(world.scene(), &light, &light_id), "from 1 to 0 s");
  light.on_from_s = 0;
  light.angular_velocity[2] = INFINITY;
  expect_refused(kuafu_scene_add_light(world.scene(), &light, &light_id), "angular_velocity is inf");
  SKIP_IF(why_not(KUAFU_TRACER_EMBREE));
  World embree(KUAFU_TRACER_EMBREE);
  set_velocity(embree, embree.add(quad({0, 0, 2}, {-5, 0, 0}, {0, 5, 0}), lambert(0.5f)), {0, 0, 0}, {0, 0, 1000});
  expect_refused(embree.status_of(rolling(4, 4, 1e-2)), "turns by 30 rad", KS_ERROR_UNSUPPORTED);
}

}  // namespace
}  // namespace laws
