// SPDX-License-Identifier: Apache-2.0
// Each kind of light against its closed form, and the groups of their light.
#include <algorithm>
#include <functional>

#include "kuafu/world.h"

namespace laws {
namespace {

/// Pose at `position` whose +z looks back along -z of the world.
std::array<double, 16> facing_back(const Vec3& position) { return placed(position, pi); }

/// A white Lambertian floor at z = 1 that faces -z, seen straight from before it through a narrow lens: radiance is irradiance / pi.
double irradiance_at_floor(World& world, uint32_t samples = 64, uint32_t sampling = KUAFU_SAMPLING_MIS) {
  world.add(quad({0, 0, 1}, {-0.02, 0, 0}, {0, 0.02, 0}), lambert(1.0f));
  world.desc().light_sampling = sampling;
  return pi * world.radiance(view_at({0, 0, 0.9}, 8, 8, 4000), samples, 0).mean();
}

TEST(Lights, a_directional_light_gives_its_irradiance_times_the_cosine) {
  for (const double angle : {0.0, 0.01, 0.2}) {
    World world;
    kuafu_light_desc light = light_of(KUAFU_LIGHT_DIRECTIONAL, 2.0f);
    light.angle_rad = angle;
    world.add_light(light, placed({0, 0, 0}, 0.6));
    EXPECT_NEAR(irradiance_at_floor(world), 2 * std::cos(0.6), 5e-3) << angle;
  }
}

TEST(Lights, a_point_light_with_a_radius_gives_what_a_point_gives) {
  // A sphere's irradiance on a surface that sees all of it is that of a point (Lambert's sphere).
  for (const double radius : {0.0, 0.01, 0.3}) {
    World world;
    world.add_light(light_of(KUAFU_LIGHT_POINT, 1.0f, radius), placed({0.3, 0, 0.5}));
    const double d2 = 0.09 + 0.25;
    EXPECT_NEAR(irradiance_at_floor(world, 256), 0.5 / std::pow(d2, 1.5), 0.01) << radius;
  }
}

TEST(Lights, a_spot_is_full_inside_and_dark_outside) {
  const auto lit = [](double aside, double inner, double outer) {
    World world;
    kuafu_light_desc light = light_of(KUAFU_LIGHT_SPOT, 1.0f);
    light.inner_rad = inner;
    light.outer_rad = outer;
    world.add_light(light, placed({std::tan(aside), 0, 0}));
    return irradiance_at_floor(world, 1) / std::pow(std::cos(aside), 3);
  };
  EXPECT_NEAR(lit(0.2, 0.3, 0.4), 1, 1e-3);
  EXPECT_EQ(lit(0.45, 0.3, 0.4), 0);
  const double part = (std::cos(0.35) - std::cos(0.4)) / (std::cos(0.3) - std::cos(0.4));
  EXPECT_NEAR(lit(0.35, 0.3, 0.4), part * part, 0.02);
}

/// Irradiance by quadrature of a rectangle of radiance 1 in the plane z = 0 that shines to +z, on the floor at (0, 0, 1).
double quadrature(double half_width, double half_height, const std::function<double(double, double)>& radiance) {
  constexpr int n = 400;
  double sum = 0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const double x = half_width * (2 * (i + 0.5) / n - 1), y = half_height * (2 * (j + 0.5) / n - 1);
      sum += radiance(x, y) / std::pow(x * x + y * y + 1, 2);
    }
  return sum * 4 * half_width * half_height / (n * n);
}

TEST(Lights, a_disk_and_a_rectangle_give_their_form_factors) {
  for (const uint32_t sampling : {KUAFU_SAMPLING_MIS, KUAFU_SAMPLING_LIGHTS, KUAFU_SAMPLING_BSDF}) {
    World disk, rectangle;
    disk.add_light(light_of(KUAFU_LIGHT_DISK, 1.0f, 0.5), placed({0, 0, 0}));
    EXPECT_NEAR(irradiance_at_floor(disk, 1024, sampling), pi * 0.25 / 1.25, 0.01) << sampling;  // pi sin^2 of the half angle
    rectangle.add_light(rectangle_light(1.0f, 1, 0.6), placed({0, 0, 0}));
    EXPECT_NEAR(irradiance_at_floor(rectangle, 1024, sampling), quadrature(0.5, 0.3, [](double, double) { return 1.0; }), 0.01) << sampling;
  }
}

TEST(Lights, area_lights_shine_to_one_side) {
  World world;
  world.add_light(light_of(KUAFU_LIGHT_DISK, 1.0f, 0.5), facing_back({0, 0, 0}));
  EXPECT_EQ(irradiance_at_floor(world), 0);
}

TEST(Lights, a_texture_shapes_an_area_light) {
  World world;
  kuafu_light_desc light = rectangle_light(1.0f, 2, 2);
  std::vector<float> ramp(64 * 64);
  for (size_t i = 0; i < ramp.size(); ++i) ramp[i] = float(i % 64) / 63;
  light.texture = world.add_texture(texture_of(ramp, 64));
  world.add_light(light, placed({0, 0, 0}));
  const double expected = quadrature(1, 1, [](double x, double) { return (x + 1) / 2; });
  EXPECT_NEAR(irradiance_at_floor(world, 1024), expected, 0.02 * expected);
}

/// Emissive square of radiance 1 over a parallel floor: unit squares at distance 1 have form factor 0.19982 (Siegel and Howell, C-11).
double facing_squares(uint32_t sampling, uint32_t tracer) {
  World world(tracer);
  world.add(quad({0, 0, 1}, {-0.5, 0, 0}, {0, 0.5, 0}), lambert(1.0f));
  world.add(quad({0, 0, 0}, {0.25, 0, 0}, {0, 0.5, 0}), emitter(1.0f), placed({-0.25, 0, 0}));
  world.add(quad({0, 0, 0}, {0.25, 0, 0}, {0, 0.5, 0}), emitter(1.0f), placed({0.25, 0, 0}));
  world.desc().light_sampling = sampling;
  // Through the emitter's back, which is black to this view only by the near plane: the camera stands above it.
  kuafu_view_desc view = view_at({0, 0, -1}, 32, 32, 64);
  view.camera.near_m = 1.5;
  return world.radiance(view, 256, 0).mean();
}

TEST(Lights, two_facing_squares_have_their_form_factor_by_every_sampling) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE})
    for (const uint32_t sampling : {KUAFU_SAMPLING_MIS, KUAFU_SAMPLING_LIGHTS, KUAFU_SAMPLING_BSDF})
      EXPECT_NEAR(facing_squares(sampling, tracer), 0.19982, 0.002) << sampling;
}

kuafu_material_desc glossy(float roughness) {
  kuafu_material_desc m = kuafu_material_desc_init();
  m.metallic = 0.5f;
  m.roughness = roughness;
  m.ir_albedo = 0.8f;
  return m;
}

TEST(Lights, samplings_agree_on_gloss_under_every_light) {
  for (const float roughness : {0.2f, 0.6f}) {
    SCOPED_TRACE(roughness);
    const auto mean = [&](uint32_t sampling) {
      World world;
      world.add(quad({0, 0.3, 1}, {-1, 0, 0}, {0, 0, -1}), glossy(roughness));
      world.add(box({0.1, 0.1, 0.1}), emitter(2.0f), placed({0.3, 0.1, 1.2}, 0.4));
      world.add_light(rectangle_light(3.0f, 0.3, 0.3), facing_back({-0.3, 0, 1.6}));
      world.add_light(light_of(KUAFU_LIGHT_POINT, 0.2f, 0.1), placed({0, -0.2, 1.3}));
      kuafu_light_desc sun = light_of(KUAFU_LIGHT_DIRECTIONAL, 0.5f);
      sun.angle_rad = 0.2;
      world.add_light(sun, placed({0, 0, 0}, 2.5));
      world.desc().light_sampling = sampling;
      return world.radiance(view_at({0, 0, 0}, 24, 24, 20), 512, 2).mean();
    };
    expect_samplings_agree(mean, 0.01);
  }
}

/// Environment map with a bright patch of `size` texels around +z of the map; returns floor irradiance.
double under_map(uint32_t sampling, double yaw, float sky, int size) {
  World world;
  std::vector<float> map(64 * 32, sky);
  for (int y = 16 - (size + 1) / 2; y < 16 + size / 2; ++y)
    for (int x = 32 - (size + 1) / 2; x < 32 + size / 2; ++x) map[size_t(y * 64 + x)] = 50;
  kuafu_environment_desc e = kuafu_environment_desc_init();
  e.radiance[0] = e.radiance[1] = e.radiance[2] = e.ir_radiance = 1;
  e.texture = world.add_texture(texture_of(map, 64));
  const double c = std::cos(yaw), s = std::sin(yaw);
  const double turned[9] = {c, 0, s, 0, 1, 0, -s, 0, c};
  std::memcpy(e.map_to_world, turned, sizeof turned);
  ok(kuafu_scene_set_environment(world.scene(), &e));
  return irradiance_at_floor(world, 4096, sampling);
}

/// The same with the patch turned to the floor, which faces -z, by quadrature of the bilinear texels.
double map_integral(double sky, int size) {
  constexpr int n = 1024;
  double sum = 0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 2 * n; ++j) {
      const double theta = pi * (i + 0.5) / n, phi = pi * (j + 0.5) / n - pi;
      const auto share = [](double p, double first, double last) {  // of bilinear texels first..last
        return std::clamp(p - (first - 1), 0.0, 1.0) * std::clamp(last + 1 - p, 0.0, 1.0);
      };
      const int before = (size + 1) / 2, after = size / 2 - 1;
      const double column = (phi / (2 * pi) + 0.5) * 64 - 0.5, row = theta / pi * 32 - 0.5;
      const double bright = share(column, 32 - before, 32 + after) * share(row, 16 - before, 16 + after);
      const double cosine = std::sin(theta) * std::cos(phi);
      if (cosine > 0) sum += (sky + (50 - sky) * bright) * cosine * std::sin(theta) * (pi / n) * (pi / n);
    }
  return sum;
}

// A sun of one texel in a black sky is interpolated over its neighbours' cells: light samples find it there, too.
TEST(Lights, an_environment_map_is_the_integral_of_its_texels) {
  for (const auto& [sky, size] : {std::pair{0.0f, 1}, {0.1f, 4}})
    for (const uint32_t sampling : {KUAFU_SAMPLING_MIS, KUAFU_SAMPLING_LIGHTS, KUAFU_SAMPLING_BSDF})
      EXPECT_NEAR(under_map(sampling, pi, sky, size) / map_integral(double(sky), size), 1, 0.02) << sampling << " " << size;
  EXPECT_NEAR(under_map(KUAFU_SAMPLING_MIS, 0, 0.1f, 4) / (0.1 * pi), 1, 0.02);  // behind the floor
}

TEST(Lights, mis_is_quieter_than_either_on_a_small_emitter_over_gloss) {
  const auto noise = [](uint32_t sampling) {
    World world;
    world.add(quad({0, 0.3, 1}, {-1, 0, 0}, {0, 0, -1}), glossy(0.35f));
    world.add(quad({0, 0.1, 1.2}, {0.02, 0, 0}, {0, 0.02, 0}), emitter(20.0f));
    world.take(16, 0);
    world.desc().light_sampling = sampling;
    double sum = 0, difference = 0;
    world.desc().seed = 1;
    const Pixels a = world.radiance(view_at({0, 0, 0}, 48, 48, 60));
    world.desc().seed = 2;
    const Pixels b = world.radiance(view_at({0, 0, 0}, 48, 48, 60));
    for (size_t i = 0; i < a.values.size(); ++i) {
      sum += a.values[i];
      difference += std::pow(a.values[i] - b.values[i], 2);
    }
    return std::sqrt(difference) / sum;
  };
  const double mis = noise(KUAFU_SAMPLING_MIS), lights = noise(KUAFU_SAMPLING_LIGHTS), bsdf = noise(KUAFU_SAMPLING_BSDF);
  RecordProperty("mis", std::to_string(mis));
  EXPECT_LT(mis, 1.1 * lights);
  EXPECT_LT(mis, bsdf / 3) << "samples for equal noise: " << std::pow(bsdf / mis, 2);
}

TEST(Lights, bad_ones_are_refused_with_their_numbers) {
  World world;
  const auto refused = [&](kuafu_light_desc light, const char* word) {
    uint32_t id;
    expect_refused(kuafu_scene_add_light(world.scene(), &light, &id), word);
  };
  refused(light_of(KUAFU_LIGHT_DISK, 1), "radius_m");
  refused(light_of(KUAFU_LIGHT_RECTANGLE, 1), "size_m");
  kuafu_light_desc spot = light_of(KUAFU_LIGHT_SPOT, 1);
  spot.outer_rad = 2;
  refused(spot, "outer_rad");
  refused(light_of(7, 1), "kind");
  kuafu_light_desc grouped = light_of(KUAFU_LIGHT_POINT, 1);
  grouped.light_group = 4;
  refused(grouped, "light_group is 4");
}

constexpr uint32_t group_0 = KUAFU_OUTPUT_LIGHT_GROUP_0;
const std::vector<uint32_t> everything = {KUAFU_OUTPUT_RADIANCE,
                                          KUAFU_OUTPUT_PROJECTOR_DIRECT,
                                          KUAFU_OUTPUT_PROJECTOR_INDIRECT,
                                          KUAFU_OUTPUT_AMBIENT,
                                          group_0,
                                          group_0 + 1,
                                          group_0 + 2,
                                          group_0 + 3};

/// A room corner with a lamp, an emissive panel, a rectangle, an environment and a projector; `on` switches one group on alone.
struct Room {
  explicit Room(uint32_t tracer = KUAFU_TRACER_AUTO, int on = -1) : world(tracer) {
    world.add(quad({0, 0, 2}, {-1, 0, 0}, {0, 1, 0}), lambert(0.5f));
    world.add(quad({-1, 0, 1}, {0, 0, 1}, {0, 1, 0}), lambert(0.8f));
    const auto lit = [&](int group, float value) { return on < 0 || on == group ? value : 0.0f; };
    kuafu_material_desc panel = emitter(lit(1, 3.0f));
    panel.light_group = 1;
    world.add(quad({0.8, 0.5, 1.2}, {0.2, 0, 0}, {0, 0.2, 0}), panel);
    kuafu_light_desc lamp = light_of(KUAFU_LIGHT_POINT, lit(3, 0.7f));
    lamp.light_group = 3;
    world.add_light(lamp, placed({0.3, -0.4, 1}));
    kuafu_light_desc rectangle = rectangle_light(lit(1, 5.0f), 0.3, 0.3);
    rectangle.light_group = 1;
    world.add_light(rectangle, placed({0.5, -0.5, 0.5}, -0.4));
    world.set_environment(lit(2, 0.2f), 2);
    if (on < 0 || on == 4) world.add_projector({0, 1, 1, 0}, 2, 2, 2, 1.0f);
    world.take(64, 3);
  }
  auto images() { return world.render({view_at({0, 0, 0}, 12, 9, 10)}, everything); }
  World world;
};

TEST(LightGroups, sum_to_the_full_image) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) {
    auto images = Room(tracer).images();
    for (size_t i = 0; i < images[KUAFU_OUTPUT_RADIANCE].values.size(); ++i) {
      const auto value = [&](uint32_t output) { return double(images[output].values[i]); };
      const double ambient = value(group_0) + value(group_0 + 1) + value(group_0 + 2) + value(group_0 + 3);
      const double all = value(KUAFU_OUTPUT_PROJECTOR_DIRECT) + value(KUAFU_OUTPUT_PROJECTOR_INDIRECT) + value(KUAFU_OUTPUT_AMBIENT);
      EXPECT_NEAR(ambient, value(KUAFU_OUTPUT_AMBIENT), 1e-6 * ambient);
      EXPECT_NEAR(all, value(KUAFU_OUTPUT_RADIANCE), 1e-6 * all);
    }
    EXPECT_EQ(images[group_0].mean(), 0.0);  // no light says 0
  }
}

TEST(LightGroups, hold_what_their_lights_give_alone) {
  auto all = Room().images();
  for (const uint32_t group : {1u, 2u, 3u}) {
    auto alone = Room(KUAFU_TRACER_AUTO, int(group)).images();
    EXPECT_GT(alone[KUAFU_OUTPUT_RADIANCE].mean(), 0.02);
    EXPECT_NEAR(all[group_0 + group].mean(), alone[KUAFU_OUTPUT_RADIANCE].mean(), 0.02 * alone[KUAFU_OUTPUT_RADIANCE].mean()) << group;
    for (const uint32_t other : {1u, 2u, 3u}) {
      if (other == group) continue;
      EXPECT_EQ(alone[group_0 + other].mean(), 0.0) << group << other;
    }
  }
}

TEST(AmbientDirect, is_the_ambient_light_without_bounces) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) {
    Room room(tracer);
    const kuafu_view_desc view = view_at({0, 0, 0}, 12, 9, 10);
    auto parts = room.world.render({view}, {KUAFU_OUTPUT_AMBIENT, KUAFU_OUTPUT_AMBIENT_DIRECT});
    auto whole = room.world.render({view}, {KUAFU_OUTPUT_AMBIENT});
    room.world.take(64, 0);
    auto once = room.world.render({view}, {KUAFU_OUTPUT_AMBIENT});
    EXPECT_GT(parts[KUAFU_OUTPUT_AMBIENT].mean(), 1.05 * once[KUAFU_OUTPUT_AMBIENT].mean());
    for (size_t i = 0; i < once[KUAFU_OUTPUT_AMBIENT].values.size(); ++i) {
      const double direct = once[KUAFU_OUTPUT_AMBIENT].values[i], all = whole[KUAFU_OUTPUT_AMBIENT].values[i];
      EXPECT_NEAR(parts[KUAFU_OUTPUT_AMBIENT_DIRECT].values[i], direct, 1e-6 * direct);
      EXPECT_NEAR(parts[KUAFU_OUTPUT_AMBIENT].values[i], all, 1e-5 * all);
    }
  }
}

TEST(LightGroups, asked_for_or_not_the_image_is_the_same) {
  Room room;
  const kuafu_view_desc view = view_at({0, 0, 0}, 12, 9, 10);
  auto with = room.images();
  auto without = room.world.render({view}, {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_AMBIENT});
  for (size_t i = 0; i < with[KUAFU_OUTPUT_RADIANCE].values.size(); ++i) {
    const double expected = without[KUAFU_OUTPUT_RADIANCE].values[i];
    EXPECT_NEAR(with[KUAFU_OUTPUT_RADIANCE].values[i], expected, 1e-5 * expected);
  }
}

}  // namespace
}  // namespace laws
