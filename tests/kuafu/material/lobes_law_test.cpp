// SPDX-License-Identifier: Apache-2.0
// Brushed metal, fibres, thin films and dispersive glass as images show them, on both kinds of tracer.
#include "kuafu/material/measured.h"

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

const std::vector<uint8_t> texel{51, 102, 153, 204};  // 0.2, 0.4, 0.6 and 0.8

/// A lobe's texture, and what says the same as its one texel without it.
struct LobeTexture {
  uint32_t kuafu_material_desc::*texture;
  void (*factor)(kuafu_material_desc& m);
};
const LobeTexture lobe_textures[] = {
    {&kuafu_material_desc::clearcoat_texture, [](kuafu_material_desc& m) { m.clearcoat *= 0.2f; }},
    {&kuafu_material_desc::clearcoat_roughness_texture, [](kuafu_material_desc& m) { m.clearcoat_roughness *= 0.4f; }},
    {&kuafu_material_desc::diffuse_transmission_texture, [](kuafu_material_desc& m) { m.diffuse_transmission *= 0.8f; }},
    {&kuafu_material_desc::diffuse_transmission_color_texture,
     [](kuafu_material_desc& m) {
       for (int k = 0; k < 3; ++k) m.diffuse_transmission_color[k] *= 0.2f * float(k + 1);
     }},
    {&kuafu_material_desc::sheen_color_texture,
     [](kuafu_material_desc& m) {
       for (int k = 0; k < 3; ++k) m.sheen_color[k] *= 0.2f * float(k + 1);
     }},
    {&kuafu_material_desc::sheen_roughness_texture, [](kuafu_material_desc& m) { m.sheen_roughness *= 0.8f; }},
    {&kuafu_material_desc::iridescence_texture, [](kuafu_material_desc& m) { m.iridescence *= 0.2f; }},
    {&kuafu_material_desc::iridescence_thickness_texture,
     [](kuafu_material_desc& m) {
       m.iridescence_thickness_nm = 0.6f * m.iridescence_least_thickness_nm + 0.4f * m.iridescence_thickness_nm;
     }},
    {&kuafu_material_desc::anisotropy_texture,
     [](kuafu_material_desc& m) {
       m.anisotropy *= 0.6f;
       m.anisotropy_rotation_rad += float(std::atan2(2 * 0.4 - 1, 2 * 0.2 - 1));  // red and green are a direction in -1 to 1
     }},
};

/// Every lobe that has textures.
kuafu_material_desc all_lobes() {
  kuafu_material_desc m = white(0.5f);
  m.anisotropy = 0.9f;
  m.anisotropy_rotation_rad = 0.3f;
  for (float& c : m.sheen_color) c = 0.8f;
  m.sheen_roughness = 0.6f;
  m.iridescence = 0.9f;
  m.iridescence_least_thickness_nm = 150;
  m.iridescence_thickness_nm = 450;
  m.clearcoat = 0.9f;
  m.clearcoat_roughness = 0.5f;
  m.diffuse_transmission = 0.6f;
  return m;
}

double in_furnace(kuafu_material_desc material, uint32_t tracer, bool textured = false) {
  World world(tracer);
  if (textured)
    for (const LobeTexture& t : lobe_textures) material.*t.texture = world.add_texture(texture_of(texel, 1, 4));
  world.add(textured_plane(), material, placed({0, 0, 1}, 0.8));
  world.set_environment(1.0f);
  return world.radiance(visible(view_at({0, 0, 0}, 8, 8, 2000)), 256).mean();
}

// Everything at once, which the compute tracer compiles once: clear coat and light that is let through too.
TEST(Lobes, of_white_surfaces_gain_nothing_on_either_tracer) {
  kuafu_material_desc m = all_lobes();
  m.transmission = 0.3f;
  m.dispersion = 1;
  const double host = in_furnace(m, KUAFU_TRACER_AUTO), device = in_furnace(m, KUAFU_TRACER_COMPUTE);
  EXPECT_LT(host, 1.01);
  EXPECT_GT(host, 0.7);
  EXPECT_NEAR(device, host, 0.005);
  EXPECT_NEAR(in_furnace(m, KUAFU_TRACER_COMPUTE, true), in_furnace(m, KUAFU_TRACER_AUTO, true), 0.005) << "with their textures";
}

// Lit from both sides and from the side, so that every lobe shows.
TEST(LobeTextures, of_one_texel_are_their_factors) {
  const auto seen = [](const LobeTexture* texture, bool as_factor) {
    World world;
    kuafu_material_desc m = all_lobes();
    if (texture != nullptr && as_factor) texture->factor(m);
    if (texture != nullptr && !as_factor) m.*texture->texture = world.add_texture(texture_of(texel, 1, 4));
    world.add(textured_plane(), m, placed({0, 0, 1}, 0.4));
    kuafu_light_desc lamp = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
    for (float& c : lamp.intensity) c = 1;
    world.add_light(lamp, placed({0.5, 0.2, 0.2}));
    world.add_light(lamp, placed({0.1, 0.3, 1.5}));
    return world.radiance(visible(view_at({0, 0, 0}, 4, 4, 20)), 16);
  };
  const Pixels without = seen(nullptr, false);
  for (const LobeTexture& t : lobe_textures) {
    const auto index = &t - lobe_textures;
    const Pixels textured = seen(&t, false), factor = seen(&t, true);
    double changed = 0;
    for (size_t i = 0; i < without.values.size(); ++i) {
      ASSERT_GT(without.values[i], 0);
      EXPECT_NEAR(textured.values[i], factor.values[i], 1e-3 * factor.values[i]) << "texture " << index << " value " << i;
      changed = std::max(changed, std::abs(textured.values[i] / without.values[i] - 1.0));
    }
    EXPECT_GT(changed, 0.005) << "texture " << index << " shows";
  }
}

// A smooth coat over black in even light, seen at 1.3 from the mesh's normal: Fresnel's reflectance at its own normal, which a map may tilt
// by 0.5 towards the viewer, and which the base's map does not.
TEST(Clearcoat, has_normals_of_its_own) {
  enum class Map { none, of_the_coat, of_the_base };
  const auto seen = [](Map map, uint32_t tracer) {
    World world(tracer);
    const std::vector<float> normal{float(0.5 + 0.5 * std::sin(0.5)), 0.5f, float(0.5 + 0.5 * std::cos(0.5))};
    kuafu_material_desc m = lambert(0);
    m.clearcoat = 1;
    if (map != Map::none)
      (map == Map::of_the_coat ? m.clearcoat_normal_texture : m.normal_texture) = world.add_texture(texture_of(normal, 1, 3));
    world.add(textured_plane(), m, placed({0, 0, 1}, 1.3));
    world.set_environment(1.0f);
    return world.radiance(view_at({0, 0, 0}, 8, 8, 20000), 64).mean();
  };
  EXPECT_NEAR(seen(Map::none, KUAFU_TRACER_AUTO), reflectance(1.3, 1.5), 2e-3);
  EXPECT_NEAR(seen(Map::of_the_base, KUAFU_TRACER_AUTO), reflectance(1.3, 1.5), 2e-3);
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE})
    EXPECT_NEAR(seen(Map::of_the_coat, tracer), reflectance(0.8, 1.5), 2e-3);
}

/// Brushed metal seen from before under a lamp: facets tilt along the brushing's direction.
double brushed(const Vec3& lamp, float rotation, bool textured = false) {
  World world;
  kuafu_material_desc m = white(1);
  m.roughness = 0.3f;
  m.anisotropy = 0.8f;
  m.anisotropy_rotation_rad = rotation;
  const std::vector<uint8_t> up_right{218, 218, 255};  // 0.71, 0.71, and all of the strength
  if (textured) m.anisotropy_texture = world.add_texture(texture_of(up_right, 1, 3));
  world.add(textured_plane(), m, placed({0, 0, 1}));
  world.add_point(lamp, 1);
  return world.radiance(view_at({0, 0, 0}, 4, 4, 20000), 4).mean();
}

// KHR_materials_anisotropy: the rotation is counter-clockwise from the tangent, which is where u grows, towards the bitangent, which is
// where v falls: from the right to the top of a picture whose texture stands upright. The highlight is long in that direction.
TEST(Anisotropy, follows_the_texture_coordinates_and_turns_counter_clockwise) {
  const Vec3 right{0.8, 0, 0}, down{0, 0.8, 0}, up_right{0.566, -0.566, 0}, down_right{0.566, 0.566, 0};  // y points down
  const double along = brushed(right, 0), across = brushed(down, 0);
  EXPECT_GT(along, 3 * across);
  EXPECT_NEAR(brushed(down, float(pi / 2)), along, 0.01 * along);
  EXPECT_NEAR(brushed(right, float(pi / 2)), across, 0.02 * across);
  for (const bool textured : {false, true}) {
    const float rotation = textured ? 0.0f : float(pi / 4);
    EXPECT_NEAR(brushed(up_right, rotation, textured), along, 0.02 * along) << textured;
    EXPECT_LT(brushed(down_right, rotation, textured), along / 3) << textured;
  }
  EXPECT_NEAR(brushed({0, -0.8, 0}, float(pi / 4), true), along, 0.02 * along) << "the rotation turns the texture's direction on";
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
    const Pixels seen = world.radiance(visible(view_at({0, 0, 0}, 2, 2, 200000)), 256);
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
    return world.radiance(view_at({0, 0, 0}, 8, 8, 4000), 64).mean();
  };
  EXPECT_DOUBLE_EQ(seen(0, 1.5f, NAN), seen(5, 1.5f, 1.5f));
  EXPECT_NEAR(seen(5, 1.5f, NAN), seen(0, 1.5f - 0.5f * 5 * 0.0396032f, NAN), 1e-6);
}

}  // namespace
}  // namespace laws
