// SPDX-License-Identifier: Apache-2.0
// Brushed metal, fibres, thin films and dispersive glass as images show them, on both kinds of tracer.
#include "kuafu/world.h"

namespace laws {
namespace {

/// A square of 100 m whose texture coordinates grow along the image's x and y.
Shape textured_plane() {
  Shape plane = quad({0, 0, 0}, {-50, 0, 0}, {0, 50, 0});
  plane.uvs = {1, 0, 0, 0, 0, 1, 1, 1};
  return plane;
}

kuafu_material_desc white(float metallic) {
  kuafu_material_desc m = lambert(1);
  m.metallic = metallic;
  m.roughness = 0.5f;
  m.specular = 1;
  return m;
}

double in_furnace(const kuafu_material_desc& material, uint32_t tracer) {
  World world(tracer);
  world.add(textured_plane(), material, placed({0, 0, 1}, 0.8));
  world.set_environment(1.0f);
  world.desc().samples_per_pixel = 256;
  kuafu_view_desc view = view_at({0, 0, 0}, 8, 8, 2000);
  view.band = KUAFU_BAND_VISIBLE;
  return world.radiance(view).mean();
}

// Everything at once, which the compute tracer compiles once: clear coat and light that is let through too.
TEST(Lobes, of_white_surfaces_gain_nothing_on_either_tracer) {
  kuafu_material_desc m = white(0.5f);
  m.anisotropy = 0.7f;
  for (float& c : m.sheen_color) c = 0.8f;
  m.sheen_roughness = 0.5f;
  m.iridescence = 0.6f;
  m.clearcoat = 0.5f;
  m.clearcoat_roughness = 0.3f;
  m.diffuse_transmission = 0.4f;
  m.transmission = 0.3f;
  m.dispersion = 1;
  const double host = in_furnace(m, KUAFU_TRACER_AUTO), device = in_furnace(m, KUAFU_TRACER_COMPUTE);
  EXPECT_LT(host, 1.01);
  EXPECT_GT(host, 0.7);
  EXPECT_NEAR(device, host, 0.005);
}

// Light from the left and from below, seen from before: facets tilt along the brushing's direction, which a quarter turn brings to the
// other.
TEST(Anisotropy, follows_the_texture_coordinates_and_turns) {
  const auto seen = [](const Vec3& lamp, float rotation) {
    World world;
    kuafu_material_desc m = white(1);
    m.roughness = 0.3f;
    m.anisotropy = 0.8f;
    m.anisotropy_rotation_rad = rotation;
    world.add(textured_plane(), m, placed({0, 0, 1}));
    world.add_point(lamp, 1);
    world.desc().samples_per_pixel = 4;
    return world.radiance(view_at({0, 0, 0}, 4, 4, 20000)).mean();
  };
  const double along = seen({0.8, 0, 0}, 0), across = seen({0, 0.8, 0}, 0);
  EXPECT_GT(along, 3 * across);
  EXPECT_NEAR(seen({0, 0.8, 0}, float(pi / 2)), along, 0.01 * along);
  EXPECT_NEAR(seen({0.8, 0, 0}, float(pi / 2)), across, 0.02 * across);
}

// A smooth film of 1.8 on a black base of 1.5, at normal incidence: Airy's sum at 850 nm.
TEST(Iridescence, of_a_mirror_is_airys_sum) {
  const double ior = 1.8, base = 1.5, r12 = (1 - ior) / (1 + ior), r23 = (ior - base) / (ior + base);
  for (const double thickness_nm : {0.0, 118.0, 236.0}) {
    kuafu_material_desc m = lambert(0);
    m.specular = 1;
    m.roughness = 0;
    m.iridescence = 1;
    m.iridescence_ior = float(ior);
    m.iridescence_thickness_nm = float(thickness_nm);
    World world;
    world.add(textured_plane(), m, placed({0, 0, 1}));
    world.set_environment(1.0f);
    world.desc().samples_per_pixel = 16;
    const double turn = 2 * r12 * r23 * std::cos(4 * pi * ior * thickness_nm / 850);
    const double airy = (r12 * r12 + r23 * r23 + turn) / (1 + r12 * r12 * r23 * r23 + turn);
    const double bare = std::pow((base - 1) / (base + 1), 2);
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 4, 4, 20000)).mean(), thickness_nm > 0 ? airy : bare, 2e-3) << thickness_nm;
  }
}

// A ray meets the slanted face of a prism from inside, after the face before it at a right angle, and leaves by Snell's law: a strip that
// stands where one channel goes is seen in that channel alone.
TEST(Dispersion, of_a_prism_is_snells) {
  const double slant = 0.5, spread = 0.5 * 1.0 / 20 * 2;  // n - 1, over Abbe's number
  const auto index = [&](double um) {
    const auto squared = [](double u) { return 1 / (u * u); };
    return 1.5 + spread * (squared(um) - squared(0.5875618)) / (squared(0.4861327) - squared(0.6562725));
  };
  const double waves[3] = {0.6114, 0.5491, 0.4643};
  kuafu_material_desc m = glass(1.5f);
  m.dispersion = 2;
  for (int channel = 0; channel < 3; ++channel) {
    World world;
    Shape prism;
    const double c = std::cos(slant), s = std::sin(slant);
    add_quad(prism, {0, 0, -0.5}, {0, 1, 0}, {1, 0, 0});        // towards the camera
    add_quad(prism, {0, 0, 0}, {c / c, 0, -s / c}, {0, 1, 0});  // slanted: its normal is turned by `slant` towards +x
    world.add(prism, m, placed({0, 0, 2}));
    const double out = std::asin(index(waves[channel]) * std::sin(slant)) - slant;  // from +z, away from the normal
    const double far_m = 10, x = -far_m * std::tan(out);
    world.add(quad({x, 0, 2 + far_m}, {-0.03, 0, 0}, {0, 2, 0}), emitter(1));
    kuafu_view_desc view = view_at({0, 0, 0}, 2, 2, 200000);
    view.band = KUAFU_BAND_VISIBLE;
    world.desc().samples_per_pixel = 256;
    const Pixels seen = world.radiance(view);
    double mean[3] = {};
    for (uint32_t r = 0; r < 2; ++r)
      for (uint32_t col = 0; col < 2; ++col)
        for (uint32_t k = 0; k < 3; ++k) mean[k] += seen.at(0, r, col, k) / 4;
    const double n = index(waves[channel]), cos_i = c, cos_t = std::sqrt(1 - n * n * s * s);
    const double rs = (n * cos_i - cos_t) / (n * cos_i + cos_t), rp = (cos_i - n * cos_t) / (cos_i + n * cos_t);
    const double first = std::pow((n - 1) / (n + 1), 2), through = (1 - first) * (1 - (rs * rs + rp * rp) / 2);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(mean[k], k == channel ? through : 0, 0.03) << "channel " << channel << " seen in " << k;
  }
}

TEST(Dispersion, of_nothing_changes_nothing_and_infrared_is_that_of_850_nm) {
  const auto seen = [](float dispersion, float ior, float ir_ior) {
    World world;
    kuafu_material_desc m = glass(ior);
    m.dispersion = dispersion;
    m.ir_ior = ir_ior;
    world.add(box({5, 5, 0.1}), m, placed({0, 0, 1}, 0.5));
    world.add(quad({0, 0, 3}, {-4, 0, 0}, {0, 4, 0}), emitter(1));
    world.desc().samples_per_pixel = 64;
    return world.radiance(view_at({0, 0, 0}, 8, 8, 4000)).mean();
  };
  EXPECT_DOUBLE_EQ(seen(0, 1.5f, NAN), seen(5, 1.5f, 1.5f));
  EXPECT_NEAR(seen(5, 1.5f, NAN), seen(0, 1.5f - 0.5f * 5 * 0.0396032f, NAN), 1e-6);
}

}  // namespace
}  // namespace laws
