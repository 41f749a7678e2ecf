// SPDX-License-Identifier: Apache-2.0
// AOVs against closed forms: planes seen by pinholes, projectors as pinholes the other way round, motion as differences of projections.

#include "kuafu/world.h"

namespace {

using namespace laws;

class Aovs : public testing::TestWithParam<uint32_t> {
 protected:
  Aovs() : world_(GetParam()) { world_.desc().samples_per_pixel = 1; }
  World world_;
};

/// Where the pixel's ray meets the plane through `point` with the given normal.
Vec3 on_plane(const kuafu_view_desc& view, uint32_t row, uint32_t column, const Vec3& point, const Vec3& normal) {
  const double* k = view.camera.k;
  const Vec3 ray{(column - k[2]) / k[0], (row - k[5]) / k[4], 1};
  return ray * (glm::dot(point, normal) / glm::dot(ray, normal));
}

TEST_P(Aovs, say_where_the_surface_is_and_what_it_is_made_of) {
  const double lean = 0.4;
  kuafu_material_desc material = kuafu_material_desc_init();
  for (int c = 0; c < 3; ++c) material.base_color[c] = 0.2f + 0.1f * float(c);
  material.ir_albedo = 0.7f;
  material.roughness = 0.35f;
  material.transmission = 0.25f;
  const Vec3 normal{std::sin(lean), 0, -std::cos(lean)};
  const uint32_t id = world_.add(quad({0, 0, 2}, {-0.3 * std::cos(lean), 0, -0.3 * std::sin(lean)}, {0, 2, 0}), material);
  for (const uint32_t band : {KUAFU_BAND_INFRARED, KUAFU_BAND_VISIBLE}) {
    kuafu_view_desc view = view_at({0, 0, 0}, 24, 6, 40);
    view.band = band;
    auto images = world_.render({view}, {KUAFU_OUTPUT_POSITION, KUAFU_OUTPUT_DEPTH, KUAFU_OUTPUT_ALBEDO, KUAFU_OUTPUT_ROUGHNESS,
                                         KUAFU_OUTPUT_TRANSMISSION, KUAFU_OUTPUT_INSTANCE_ID, KUAFU_OUTPUT_SEMANTIC_ID});
    uint32_t hits = 0;
    for (uint32_t row = 0; row < 6; ++row)
      for (uint32_t column = 0; column < 24; ++column) {
        const Vec3 p = on_plane(view, row, column, {0, 0, 2}, normal);
        const bool hit = std::abs(p[0]) < 0.3 * std::cos(lean);
        hits += hit;
        EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(0, row, column), hit ? id - 1 : KUAFU_NOTHING_HIT);
        EXPECT_EQ(images[KUAFU_OUTPUT_SEMANTIC_ID].id_at(0, row, column), hit ? 0u : KUAFU_NOTHING_HIT);
        EXPECT_EQ(images[KUAFU_OUTPUT_ROUGHNESS].at(0, row, column), hit ? 0.35f : 0.0f);
        EXPECT_EQ(images[KUAFU_OUTPUT_TRANSMISSION].at(0, row, column), hit ? 0.25f : 0.0f);
        for (uint32_t c = 0; c < images[KUAFU_OUTPUT_ALBEDO].channels; ++c)
          EXPECT_FLOAT_EQ(images[KUAFU_OUTPUT_ALBEDO].at(0, row, column, c), !hit                          ? 0
                                                                             : band == KUAFU_BAND_INFRARED ? 0.7f
                                                                                                           : 0.2f + 0.1f * float(c));
        for (uint32_t i = 0; i < 3; ++i) {
          const float position = images[KUAFU_OUTPUT_POSITION].at(0, row, column, i);
          EXPECT_TRUE(hit ? std::abs(position - p[i]) < 2e-6 : std::isnan(position)) << position << ' ' << p[i];
        }
        EXPECT_NEAR(images[KUAFU_OUTPUT_DEPTH].at(0, row, column), hit ? p[2] : 0, 2e-6);
      }
    EXPECT_GT(hits, 30u);
    EXPECT_LT(hits, 24u * 6u);
  }
}

TEST_P(Aovs, tell_meanings_apart) {
  const Shape near = quad({-0.5, 0, 1}, {-0.4, 0, 0}, {0, 1, 0}), far = quad({0.5, 0, 1}, {-0.4, 0, 0}, {0, 1, 0});
  world_.add(near, lambert(0.5f), placed({0, 0, 0}), KUAFU_ALL_ENVIRONMENTS, 7);
  world_.add(far, lambert(0.5f), placed({0, 0, 0}), KUAFU_ALL_ENVIRONMENTS, 70000);
  const Pixels image = world_.image(view_at({0, 0, 0}, 8, 2, 4), KUAFU_OUTPUT_SEMANTIC_ID);
  EXPECT_EQ(image.id_at(0, 0, 1), 7u);
  EXPECT_EQ(image.id_at(0, 1, 6), 70000u);
}

/// A wall at 2 m, a projector 0.11 m to the right of the camera, and a thin bar half way that shadows it.
struct Projection {
  explicit Projection(World& world, double k1 = 0, double p1 = 0) {
    world.add(quad({0, 0, 2}, {-3, 0, 0}, {0, 3, 0}), lambert(0.6f));
    bar = world.add(quad({0, 0, 1}, {-0.03, 0, 0}, {0, 3, 0}), lambert(0.6f));
    const std::vector<float> white(64 * 48, 1.0f);
    kuafu_light_desc desc = world.projector(white, 64, 48, focal, intensity);
    desc.lens.distortion[0] = k1, desc.lens.distortion[2] = p1;
    light = world.add_light(desc, placed({baseline, 0, 0}));
  }
  static constexpr double focal = 80, baseline = 0.11;
  static constexpr float intensity = 3;
  uint32_t bar = 0, light = 0;
};

const std::vector<uint32_t> projector_outputs = {
    KUAFU_OUTPUT_POSITION,           KUAFU_OUTPUT_INSTANCE_ID,      KUAFU_OUTPUT_PROJECTOR_UV, KUAFU_OUTPUT_PROJECTOR_VISIBILITY,
    KUAFU_OUTPUT_PROJECTOR_GEOMETRY, KUAFU_OUTPUT_PROJECTOR_DIRECT, KUAFU_OUTPUT_ALBEDO};

TEST_P(Aovs, see_the_projector_as_a_camera) {
  const Projection p(world_);
  const kuafu_view_desc view = view_at({0, 0, 0}, 60, 5, 50);
  auto images = world_.render({view}, projector_outputs);
  uint32_t inside = 0, shadowed = 0;
  for (uint32_t column = 0; column < 60; ++column) {
    const bool on_bar = images[KUAFU_OUTPUT_INSTANCE_ID].id_at(0, 2, column) == p.bar - 1;
    const double z = on_bar ? 1 : 2, x = (column - view.camera.k[2]) / 50 * z;
    const double u = Projection::focal * (x - Projection::baseline) / z + 31.5,
                 d2 = (x - Projection::baseline) * (x - Projection::baseline) + z * z;
    const bool in_pattern = u >= -0.5 && u < 63.5;
    // The bar's shadow on the wall, seen from the projector.
    const double at_bar = Projection::baseline + (x - Projection::baseline) / 2;
    const bool shadow = !on_bar && std::abs(at_bar) < 0.03;
    const auto value = [&](uint32_t output, uint32_t channel = 0) { return images[output].at(0, 2, column, channel); };
    EXPECT_EQ(!std::isnan(value(KUAFU_OUTPUT_PROJECTOR_UV)), in_pattern) << column;
    if (in_pattern) {
      EXPECT_NEAR(value(KUAFU_OUTPUT_PROJECTOR_UV), u, 1e-4) << column;
      EXPECT_NEAR(value(KUAFU_OUTPUT_PROJECTOR_UV, 1), 23.5, 1e-4) << column;
    }
    EXPECT_NEAR(value(KUAFU_OUTPUT_PROJECTOR_GEOMETRY), z / std::sqrt(d2) / d2, 1e-6) << column;
    EXPECT_EQ(value(KUAFU_OUTPUT_PROJECTOR_VISIBILITY), in_pattern && !shadow ? 1.0f : 0.0f) << column;
    inside += in_pattern;
    shadowed += in_pattern && shadow;
  }
  EXPECT_GT(inside, 20u);
  EXPECT_LT(inside, 60u);
  EXPECT_GT(shadowed, 1u);
}

TEST_P(Aovs, give_the_projectors_light) {
  const Projection p(world_);
  world_.desc().samples_per_pixel = 16;
  auto images =
      world_.render({view_at({0, 0, 0}, 50, 30, 200)}, projector_outputs);  // small pixels: centre and mean agree, edges of shadows aside
  const Pixels &direct = images[KUAFU_OUTPUT_PROJECTOR_DIRECT], &visible = images[KUAFU_OUTPUT_PROJECTOR_VISIBILITY];
  uint32_t compared = 0, dark = 0;
  for (uint32_t row = 1; row < 29; ++row)
    for (uint32_t column = 1; column < 49; ++column) {
      const float v = visible.at(0, row, column);
      const bool edge =
          visible.at(0, row, column - 1) != v || visible.at(0, row, column + 1) != v ||
          images[KUAFU_OUTPUT_INSTANCE_ID].id_at(0, row, column - 1) != images[KUAFU_OUTPUT_INSTANCE_ID].id_at(0, row, column + 1);
      if (edge) continue;
      const double expected = images[KUAFU_OUTPUT_ALBEDO].at(0, row, column) / pi * Projection::intensity * v *
                              images[KUAFU_OUTPUT_PROJECTOR_GEOMETRY].at(0, row, column);
      EXPECT_NEAR(direct.at(0, row, column), expected, 2e-4 * expected);
      ++compared;
      dark += v == 0;
    }
  EXPECT_GT(compared, 900u);
  EXPECT_GT(dark, 30u);
}

TEST_P(Aovs, follow_the_projectors_lens) {
  const Projection p(world_, 0.2, 0.01);
  world_.desc().projector = p.light;
  auto images = world_.render({view_at({0, 0, 0}, 20, 9, 50)}, {KUAFU_OUTPUT_PROJECTOR_UV, KUAFU_OUTPUT_POSITION});
  for (uint32_t row = 0; row < 9; ++row)
    for (uint32_t column = 0; column < 20; ++column) {
      const auto at = [&](uint32_t i) { return double(images[KUAFU_OUTPUT_POSITION].at(0, row, column, i)); };
      const double x = (at(0) - Projection::baseline) / at(2), y = at(1) / at(2), r2 = x * x + y * y;
      EXPECT_NEAR(images[KUAFU_OUTPUT_PROJECTOR_UV].at(0, row, column, 0), 80 * (x * (1 + 0.2 * r2) + 2 * 0.01 * x * y) + 31.5, 1e-3);
      EXPECT_NEAR(images[KUAFU_OUTPUT_PROJECTOR_UV].at(0, row, column, 1), 80 * (y * (1 + 0.2 * r2) + 0.01 * (r2 + 2 * y * y)) + 23.5,
                  1e-3);
    }
}

TEST_P(Aovs, ask_the_projector_of_the_views_environment) {
  world_.add(quad({0, 0, 2}, {-3, 0, 0}, {0, 3, 0}), lambert(0.6f));
  kuafu_light_desc light = world_.projector(std::vector<float>(16, 1.0f), 4, 4, 20, 0);  // dark: still where it is
  light.environment = 1;
  world_.add_light(light, placed({0.02, 0, 0}));
  std::vector<kuafu_view_desc> views(2, view_at({0, 0, 0}, 3, 3, 50));
  views[1].environment = 1;
  auto images = world_.render(views, {KUAFU_OUTPUT_PROJECTOR_UV, KUAFU_OUTPUT_PROJECTOR_VISIBILITY});
  EXPECT_TRUE(std::isnan(images[KUAFU_OUTPUT_PROJECTOR_UV].at(0, 1, 1)));
  EXPECT_EQ(images[KUAFU_OUTPUT_PROJECTOR_VISIBILITY].at(0, 1, 1), 0.0f);
  EXPECT_NEAR(images[KUAFU_OUTPUT_PROJECTOR_UV].at(1, 1, 1), 20 * -0.02 / 2 + 1.5, 1e-5);
  EXPECT_EQ(images[KUAFU_OUTPUT_PROJECTOR_VISIBILITY].at(1, 1, 1), 1.0f);
}

TEST(Projector, of_the_aovs_must_be_one) {
  World world;
  world.desc().projector = world.add_point({0, 0, 0}, 1);
  expect_refused(world.status_of(view_at({0, 0, 0}, 1, 1, 1), KUAFU_OUTPUT_PROJECTOR_UV), "projector is 1");
}

TEST_P(Aovs, of_no_projector_in_particular_are_of_the_first_one) {
  world_.add(quad({0, 0, 2}, {-9, 0, 0}, {0, 9, 0}), lambert(0.5f));
  world_.add_point({0, 0, 0}, 1);
  world_.add_projector(std::vector<float>(64, 1.0f), 8, 8, 4, 1);
  const kuafu_view_desc view = view_at({0, 0, 0}, 1, 1, 60);
  EXPECT_EQ(world_.image(view, KUAFU_OUTPUT_PROJECTOR_VISIBILITY).mean(), 1);
}

// A body of constant speed moves by the same in every line of a rolling shutter, whenever that is read.
TEST_P(Aovs, of_motion_are_from_a_line_to_the_same_line_one_frame_before) {
  const double speed = 2.0, frame_s = 0.03;
  const uint32_t moving = world_.add(quad({0, 0, 0}, {-9, 0, 0}, {0, 9, 0}), lambert(0.5f), placed({-speed * frame_s, 0, 2}));
  const double linear[3] = {speed, 0, 0}, angular[3] = {};
  ok(kuafu_scene_set_instance_velocity(world_.scene(), moving, linear, angular));
  ok(kuafu_scene_set_instance_pose(world_.scene(), moving, placed({0, 0, 2}).data()));
  kuafu_view_desc view = view_at({0, 0, 0}, 8, 21, 60);
  view.camera.shutter = KUAFU_SHUTTER_ROLLING;
  view.camera.line_time_s = 1e-3;
  const Pixels m = world_.image(view, KUAFU_OUTPUT_MOTION);
  for (uint32_t row = 0; row < 21; ++row) EXPECT_NEAR(m.at(0, row, 4, 0), 60 * speed * frame_s / 2, 1e-3) << row;
}

TEST_P(Aovs, of_motion_are_differences_of_projections) {
  world_.add(quad({0, 0, 4}, {-9, 0, 0}, {0, 9, 0}), lambert(0.5f));
  const uint32_t moving = world_.add(quad({0, 0, 0}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f), placed({0, 0, 2}));
  kuafu_view_desc view = view_at({0, 0, 0}, 31, 21, 60);
  const auto motion = [&] { return world_.image(view, KUAFU_OUTPUT_MOTION); };
  for (const float v : motion().values) EXPECT_EQ(v, 0.0f);
  ok(kuafu_scene_set_instance_pose(world_.scene(), moving, placed({0.1, -0.05, 2}).data()));
  ok(kuafu_scene_set_instance_pose(world_.scene(), moving, placed({0.1, -0.05, 2.5}).data()));
  Pixels m = motion();
  // Pixel (15, 10) sees (0, 0, 2.5) of the square, which was at (-0.1, 0.05, 2).
  EXPECT_NEAR(m.at(0, 10, 15, 0), 60 * 0.1 / 2, 1e-4);
  EXPECT_NEAR(m.at(0, 10, 15, 1), 60 * -0.05 / 2, 1e-4);
  EXPECT_EQ(m.at(0, 0, 0, 0), 0.0f);  // the wall stands
  ok(kuafu_scene_next_frame(world_.scene()));
  for (const float v : motion().values) EXPECT_EQ(v, 0.0f);
  // A camera that came from the left: what it sees moved to the left, by focal * step / z.
  const auto before = placed({-0.3, 0, 0});
  std::copy(before.begin(), before.end(), view.previous_camera_to_world);
  m = motion();
  EXPECT_NEAR(m.at(0, 10, 15, 0), -60 * 0.3 / 2.5, 1e-4);
  EXPECT_NEAR(m.at(0, 0, 0, 0), -60 * 0.3 / 4, 1e-4);
  EXPECT_NEAR(m.at(0, 0, 0, 1), 0, 1e-4);
  // Everything was behind a camera that looked the other way.
  const auto away = placed({0, 0, 0}, pi);
  std::copy(away.begin(), away.end(), view.previous_camera_to_world);
  for (const float v : motion().values) EXPECT_TRUE(std::isnan(v));
}

INSTANTIATE_TEST_SUITE_P(Stages, Aovs, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE), stages_name);

}  // namespace
