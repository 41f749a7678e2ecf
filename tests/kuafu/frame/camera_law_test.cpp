// SPDX-License-Identifier: Apache-2.0
// Cameras: images, shutters, lenses, bands, environments.
#include <glm/gtc/type_ptr.hpp>

#include "kuafu/world.h"

namespace laws {
namespace {

TEST(Camera, depth_is_z_and_ids_are_the_scene_s) {
  World world;
  world.add(quad({0, 0, 2}, {-5, 0, 0}, {0, 5, 0}), lambert(0.5f));
  const uint32_t near_id = world.add(quad({0.5, 0, 1}, {-0.5, 0, 0}, {0, 5, 0}), lambert(0.5f));
  const uint32_t removed = world.add(quad({0, 0, 0.5}, {-5, 0, 0}, {0, 5, 0}), lambert(0.5f));
  ok(kuafu_scene_remove_instance(world.scene(), removed));
  const uint32_t late_id = world.add(quad({-0.9, 0, 1.5}, {-0.1, 0, 0}, {0, 5, 0}), lambert(0.5f));
  auto images = world.render({view_at({0, 0, 0}, 65, 33, 30)},
                             {KUAFU_OUTPUT_DEPTH, KUAFU_OUTPUT_NORMAL, KUAFU_OUTPUT_INSTANCE_ID, KUAFU_OUTPUT_MATERIAL_ID});
  for (uint32_t c = 0; c < 65; ++c) {
    const double x = (c - 32.0) / 30;
    if (std::abs(x - 0.0) < 0.02 || std::abs(std::abs(x * 1.5 + 0.9) - 0.1) < 0.02 || std::abs(x - 1) < 0.02) continue;
    const bool near = x > 0 && x<1, late = x * 1.5> - 1 && x * 1.5 < -0.8;
    EXPECT_NEAR(images[KUAFU_OUTPUT_DEPTH].at(0, 5, c), near ? 1.0 : late ? 1.5 : 2.0, 1e-5) << c;
    EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(0, 5, c), near ? near_id - 1 : late ? late_id - 1 : 0u) << c;
    EXPECT_EQ(images[KUAFU_OUTPUT_MATERIAL_ID].id_at(0, 5, c), near ? 1u : late ? 3u : 0u) << c;
    EXPECT_NEAR(images[KUAFU_OUTPUT_NORMAL].at(0, 5, c, 2), -1.0, 1e-6) << c;
  }
}

TEST(Camera, nothing_hit_is_zero_depth_and_no_id) {
  World world;
  world.add(quad({0, 0, -2}, {1, 0, 0}, {0, 1, 0}), lambert(0.5f));
  auto images = world.render({view_at({0, 0, 0}, 4, 4, 30)}, {KUAFU_OUTPUT_DEPTH, KUAFU_OUTPUT_INSTANCE_ID, KUAFU_OUTPUT_RADIANCE});
  EXPECT_EQ(images[KUAFU_OUTPUT_DEPTH].at(0, 1, 1), 0.0f);
  EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(0, 1, 1), KUAFU_NOTHING_HIT);
  EXPECT_EQ(images[KUAFU_OUTPUT_RADIANCE].mean(), 0.0);
}

TEST(Camera, near_and_far_cut_by_z) {
  World world;
  for (const double z : {1.0, 2.0, 3.0}) world.add(quad({0, 0, z}, {-9, 0, 0}, {0, 9, 0}), emitter(float(z)));
  kuafu_view_desc view = view_at({0, 0, 0}, 33, 33, 15);
  view.camera.near_m = 1.5;
  auto images = world.render({view}, {KUAFU_OUTPUT_DEPTH, KUAFU_OUTPUT_RADIANCE});
  for (const float z : images[KUAFU_OUTPUT_DEPTH].values) ASSERT_NEAR(z, 2.0f, 1e-5);
  for (const float l : images[KUAFU_OUTPUT_RADIANCE].values) ASSERT_NEAR(l, 2.0f, 1e-5);
  kuafu_view_desc lens = view;  // planes of z they stay
  lens.camera.lens_radius_m = 0.2;
  lens.camera.focus_m = INFINITY;
  lens.camera.lens.distortion[0] = -0.02;
  for (const float l : world.radiance(lens).values) ASSERT_NEAR(l, 2.0f, 1e-5);
  view.camera.near_m = 0;
  view.camera.far_m = 0.9;
  EXPECT_EQ(world.radiance(view).mean(), 0.0);
}

TEST(Camera, normals_are_interpolated_and_survive_scaling) {
  World world;
  auto pose = placed({0, 0, 3});
  pose[0] = 2;  // twice as wide
  world.add(sphere(0.5, 64, true), lambert(0.5f), pose);
  const Pixels normal = world.image(view_at({0, 0, 0}, 65, 65, 120), KUAFU_OUTPUT_NORMAL);
  const Pixels depth = world.image(view_at({0, 0, 0}, 65, 65, 120), KUAFU_OUTPUT_DEPTH);
  for (uint32_t r = 20; r < 45; r += 6)
    for (uint32_t c = 20; c < 45; c += 6) {
      const double z = depth.at(0, r, c), x = (c - 32.0) / 120 * z, y = (r - 32.0) / 120 * z;
      const Vec3 n{x / 4, y, z - 3};  // gradient of (x/2)^2 + y^2 + (z-3)^2
      const double length = std::hypot(n[0], n[1], n[2]);
      for (uint32_t i = 0; i < 3; ++i) EXPECT_NEAR(normal.at(0, r, c, i), n[i] / length, 0.01);
    }
}

TEST(Bands, infrared_takes_its_own_albedo_and_lights) {
  World world;
  kuafu_material_desc m = lambert(0.0f);
  m.base_color[0] = 0.8f;
  m.base_color[1] = 0.4f;
  m.base_color[2] = 0.2f;
  m.ir_albedo = 0.3f;
  world.add(quad({0, 0, 1}, {-9, 0, 0}, {0, 9, 0}), m);
  kuafu_environment_desc e = kuafu_environment_desc_init();
  for (float& r : e.radiance) r = 2.0f;
  ok(kuafu_scene_set_environment(world.scene(), &e));
  kuafu_view_desc view = view_at({0, 0, 0}, 4, 4, 100);
  world.desc().ir_ambient_scale = 0.05f;
  world.desc().ir_ambient_radiance = 0.01f;
  EXPECT_NEAR(world.radiance(view).mean(), 0.3 * (2.0 * 0.05 + 0.01), 1e-5);
  world.desc().ir_ambient_scale = 0.5f;
  EXPECT_NEAR(world.radiance(view).mean(), 0.3 * (2.0 * 0.5 + 0.01), 1e-4);
  view.band = KUAFU_BAND_VISIBLE;
  const Pixels visible = world.radiance(view);
  EXPECT_NEAR(visible.at(0, 1, 1, 0), 1.6, 1e-4);
  EXPECT_NEAR(visible.at(0, 1, 1, 1), 0.8, 1e-4);
  EXPECT_NEAR(visible.at(0, 1, 1, 2), 0.4, 1e-4);
  m.ir_albedo = NAN;  // red
  ok(kuafu_scene_set_material(world.scene(), 1, &m));
  view.band = KUAFU_BAND_INFRARED;
  EXPECT_NEAR(world.radiance(view).mean(), 0.8 * (2.0 * 0.5 + 0.01), 1e-4);
}

TEST(Environments, each_view_sees_its_own) {
  World world;
  world.add(quad({0, 0, 2}, {-9, 0, 0}, {0, 9, 0}), lambert(0.5f));
  const uint32_t mine = world.add(quad({0, 0, 1}, {-0.3, 0, 0}, {0, 0.3, 0}), lambert(0.5f), placed({0, 0, 0}), 1);
  world.add_point({0, 0, 0}, 1.0f, 0);
  world.add_point({0, 0, 0}, 3.0f, 2);
  world.desc().max_bounces = 0;
  std::vector<kuafu_view_desc> views(3, view_at({0, 0, 0}, 5, 5, 100));
  for (uint32_t i = 0; i < 3; ++i) views[i].environment = i;
  auto images = world.render(views, {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_INSTANCE_ID});
  EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(0, 2, 2), 0u);
  EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(1, 2, 2), mine - 1);
  EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(2, 2, 2), 0u);
  EXPECT_NEAR(images[KUAFU_OUTPUT_RADIANCE].at(0, 2, 2), 0.5 / pi / 4, 1e-4);
  EXPECT_EQ(images[KUAFU_OUTPUT_RADIANCE].at(1, 2, 2), 0.0f);
  EXPECT_NEAR(images[KUAFU_OUTPUT_RADIANCE].at(2, 2, 2), 3 * 0.5 / pi / 4, 3e-4);
}

constexpr double focal_px = 100, wall_m = 2;

/// Shines 1 where x < edge_m, on a plane at wall_m; `vertical` = false: where y < edge_m.
void add_half_plane(World& world, double edge_m, bool vertical = true) {
  const Vec3 centre = vertical ? Vec3{edge_m - 50, 0, wall_m} : Vec3{0, edge_m - 50, wall_m};
  world.add(quad(centre, {-50, 0, 0}, {0, 50, 0}), emitter(1.0f));
}

kuafu_view_desc camera(uint32_t width, uint32_t height) { return view_at({0, 0, 0}, width, height, focal_px); }

/// Where the shining half ends in a row (or column), in pixels from the image's middle: the sum of its values.
double edge_px(const Pixels& image, uint32_t line, bool vertical) {
  const uint32_t length = vertical ? image.width : image.height;
  double sum = 0;
  for (uint32_t i = 0; i < length; ++i) sum += vertical ? image.at(0, line, i) : image.at(0, i, line);
  return sum - 0.5 * length;
}

struct Readout {
  const char* name;
  uint32_t value;
  bool rows, forward;
};
constexpr Readout readouts[] = {{"RowsDown", KUAFU_READOUT_ROWS_DOWN, true, true},
                                {"RowsUp", KUAFU_READOUT_ROWS_UP, true, false},
                                {"ColumnsRight", KUAFU_READOUT_COLUMNS_RIGHT, false, true},
                                {"ColumnsLeft", KUAFU_READOUT_COLUMNS_LEFT, false, false}};

class EachReadout : public testing::TestWithParam<Readout> {};
INSTANTIATE_TEST_SUITE_P(All, EachReadout, testing::ValuesIn(readouts), [](const auto& info) { return info.param.name; });

/// An edge along the lines' order, crossed by the camera's motion: line i sees it at f (edge - v t_i) / z.
TEST_P(EachReadout, shears_a_moving_edge) {
  const Readout& readout = GetParam();
  World world;
  add_half_plane(world, 0.05, readout.rows);
  kuafu_view_desc view = camera(40, 36);
  view.camera.shutter = KUAFU_SHUTTER_ROLLING;
  view.camera.readout = readout.value;
  view.camera.line_time_s = 1e-3;
  const double speed = 3.0;
  view.camera.linear_velocity[readout.rows ? 0 : 1] = speed;
  const Pixels image = world.radiance(view, 64);
  const uint32_t lines = readout.rows ? 36 : 40;
  for (uint32_t i = 0; i < lines; ++i) {
    const double seconds = (readout.forward ? 1 : -1) * (i - (lines - 1) / 2.0) * 1e-3;
    EXPECT_NEAR(edge_px(image, i, readout.rows), focal_px * (0.05 - speed * seconds) / wall_m, 0.03) << "line " << i;
  }
}

/// A lens that moves by w while open spreads an edge over w: the pixel's value is the mean of the step over the pixel and the way.
TEST(Shutter, exposure_blurs_an_edge_by_a_box) {
  World world;
  add_half_plane(world, 0.0);
  kuafu_view_desc view = camera(41, 5);
  view.camera.exposure_s = 0.01;
  view.camera.linear_velocity[0] = -20;  // 0.2 m, 10 pixels
  const Pixels image = world.radiance(view, 256);
  const auto lit = [](double from, double until) {  // integral of the ramp 1 -> 0 over -5..5
    const auto integral = [](double x) { return x < -5 ? x : x > 5 ? 0.0 : x - (x + 5) * (x + 5) / 20; };
    return integral(until) - integral(from);
  };
  for (uint32_t c = 0; c < 41; ++c) EXPECT_NEAR(image.at(0, 2, c), lit(c - 20.5, c - 19.5), 0.012) << "column " << c;
}

TEST(Shutter, exposure_follows_the_line_that_is_read) {
  World world;
  add_half_plane(world, 0.0);
  kuafu_view_desc view = camera(60, 20);
  view.camera.shutter = KUAFU_SHUTTER_ROLLING;
  view.camera.exposure_s = 4e-3;
  view.camera.line_time_s = 1e-3;
  view.camera.linear_velocity[0] = 10;  // 2 pixels of blur, 0.5 of shear a line
  const Pixels image = world.radiance(view, 1024);
  for (uint32_t row = 0; row < 20; ++row) {
    const double middle = -0.5 * (row - 9.5);
    EXPECT_NEAR(edge_px(image, row, true), middle, 0.12) << "row " << row;
    for (uint32_t c = 0; c < 60; ++c) {
      const double u = c - 29.5;
      if (std::abs(u - middle) <= 1.5) continue;
      EXPECT_NEAR(image.at(0, row, c), u < middle ? 1 : 0, 1e-5) << "row " << row << " column " << c;
    }
  }
}

/// z0 - v t: a camera that approaches a wall, AOVs at each line's mid-exposure.
TEST(Shutter, aovs_are_those_of_the_line_s_mid_exposure) {
  World world;
  world.add(quad({0, 0, wall_m}, {-50, 0, 0}, {0, 50, 0}), lambert(0.5f));
  kuafu_view_desc view = camera(16, 33);
  view.camera.shutter = KUAFU_SHUTTER_ROLLING;
  view.camera.line_time_s = 2e-3;
  view.camera.exposure_s = 0.5;  // of no concern to an AOV
  view.camera.linear_velocity[2] = 5;
  const Pixels depth = world.image(view, KUAFU_OUTPUT_DEPTH);
  for (uint32_t row = 0; row < 33; ++row) EXPECT_NEAR(depth.at(0, row, 8), wall_m - 5 * 2e-3 * (row - 16.0), 2e-6) << row;
}

/// Pose(t) = pose exp(t [v, w]): a camera that turns about its axis while it is read, against views of its poses, one a line.
TEST(Shutter, a_twist_is_the_body_s) {
  World world;
  kuafu_material_desc material = lambert(0.5f);
  world.add(quad({0.1, 0, wall_m}, {-3, 0.2, 0.9}, {0.1, 3, -0.7}), material);
  const Vec3 v{0.4, -0.7, 0.9}, w{0.3, -0.5, 0.8};
  kuafu_view_desc view = view_at({0.02, 0.03, -0.1}, 24, 9, focal_px, 0.2);
  view.camera.shutter = KUAFU_SHUTTER_ROLLING;
  view.camera.line_time_s = 0.1;
  std::copy_n(&v.x, 3, view.camera.linear_velocity);
  std::copy_n(&w.x, 3, view.camera.angular_velocity);
  const Pixels rolled = world.image(view, KUAFU_OUTPUT_DEPTH);
  for (const uint32_t row : {0u, 2u, 4u, 8u}) {
    // exp by many small steps of the body
    const double t = 0.1 * (row - 4.0);
    constexpr int steps = 20000;
    const Vec3 turn = w * (t / steps), way = v * (t / steps);
    const glm::dmat4 step(1, -turn.z, turn.y, way.x, turn.z, 1, -turn.x, way.y, -turn.y, turn.x, 1, way.z, 0, 0, 0, 1);
    glm::dmat4 pose = glm::make_mat4(view.camera.camera_to_world);
    for (int i = 0; i < steps; ++i) pose = step * pose;  // both are transposed
    kuafu_view_desc still = view_at({0, 0, 0}, 24, 9, focal_px);
    std::copy_n(glm::value_ptr(pose), 16, still.camera.camera_to_world);
    const Pixels depth = world.image(still, KUAFU_OUTPUT_DEPTH);
    for (uint32_t c = 0; c < 24; ++c) EXPECT_NEAR(rolled.at(0, row, c), depth.at(0, row, c), 1e-4) << row << " " << c;
  }
}

TEST(Shutter, an_instant_of_a_global_shutter_changes_no_bit) {
  World world;
  add_half_plane(world, 0.03);
  kuafu_view_desc view = camera(20, 10), moving = view;
  moving.camera.linear_velocity[0] = 3;
  moving.camera.angular_velocity[1] = 2;
  moving.camera.line_time_s = 1e-3;  // of no concern to a global shutter
  moving.camera.focus_m = 2;         // nor this to a pinhole
  EXPECT_EQ(world.radiance(view).values, world.radiance(moving).values);
}

/// 2 R f |1/z - 1/z0| pixels: where an edge out of focus begins and ends to shine, and its middle.
TEST(Lens, blur_circle_has_its_closed_form) {
  World world;
  add_half_plane(world, 0.0);
  kuafu_view_desc view = camera(61, 5);
  view.camera.lens_radius_m = 0.1;
  view.camera.focus_m = 1.0;
  const Pixels image = world.radiance(view, 1024);
  const double radius = 0.1 * focal_px * (1 / 1.0 - 1 / wall_m);  // 5 pixels
  // Share of a disc on the left of x: the circle's segment.
  const auto share = [&](double x) {
    const double h = std::clamp(x / radius, -1.0, 1.0);
    return 1 - (std::acos(h) - h * std::sqrt(1 - h * h)) / pi;
  };
  for (uint32_t c = 0; c < 61; ++c) {
    double mean = 0;
    for (int i = 0; i < 100; ++i) mean += share(-(c - 30.5 + (i + 0.5) / 100)) / 100;
    EXPECT_NEAR(image.at(0, 2, c), mean, 0.01) << "column " << c;
  }
}

TEST(Lens, the_focused_plane_is_sharp_and_aovs_see_through_its_centre) {
  World world;
  add_half_plane(world, 0.0);
  kuafu_view_desc view = camera(41, 5);
  view.camera.lens_radius_m = 0.1;
  view.camera.focus_m = wall_m;
  world.desc().samples_per_pixel = 64;
  auto images = world.render({view}, {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_DEPTH});
  for (uint32_t c = 0; c < 41; ++c) EXPECT_NEAR(images[KUAFU_OUTPUT_RADIANCE].at(0, 2, c), c < 20 ? 1 : c > 20 ? 0 : 0.5, 1e-2) << c;
  const Pixels pinhole = world.image(camera(41, 5), KUAFU_OUTPUT_DEPTH);
  for (size_t i = 0; i < pinhole.values.size(); ++i)
    EXPECT_NEAR(images[KUAFU_OUTPUT_DEPTH].values[i], pinhole.values[i], 1e-6 * pinhole.values[i]);
}

TEST(Camera, what_it_cannot_be_is_refused_with_the_numbers) {
  World world;
  add_half_plane(world, 0.0);
  const auto refused = [&](const auto& change, const char* part) {
    kuafu_view_desc view = camera(8, 8);
    change(view.camera);
    expect_refused(world.status_of(view), part);
  };
  using Desc = kuafu_camera_desc;
  refused([](Desc& c) { c.lens_radius_m = 0.01; }, "focus_m is 0");
  refused([](Desc& c) { c.lens_radius_m = NAN; }, "lens_radius_m is nan");
  refused([](Desc& c) { c.shutter = 2; }, "shutter is 2");
  refused([](Desc& c) { c.readout = 4; }, "readout is 4");
  refused([](Desc& c) { c.exposure_s = -1; }, "exposure_s is -1");
  refused([](Desc& c) { c.line_time_s = INFINITY; }, "line_time_s is inf");
  refused([](Desc& c) { c.angular_velocity[1] = NAN; }, "angular_velocity is nan");
  refused([](Desc& c) { c.lens.distortion[7] = NAN; }, "lens.distortion[7] is nan");
  // r (1 - r^2 / 3) grows up to r = 1, to 2/3; this image reaches 0.8 at its sides.
  refused([](Desc& c) { c.lens.distortion[0] = -1.0 / 3, c.k[0] = c.k[4] = 5; }, "grows to radius 0.66");
}

}  // namespace
}  // namespace laws
