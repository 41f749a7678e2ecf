// SPDX-License-Identifier: Apache-2.0
// How a texture is read: wrap, filter, coordinates of the second set, a transform; vertex colours and the scale of normals.
#include "kuafu/world.h"

namespace laws {
namespace {

/// A wall at z = 1 that fills an image of focal length size / 2; its uvs go from `low` at the upper left to `high` at the lower right.
struct Wall {
  std::vector<float> positions{-1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1}, uvs, uvs_1, colors;
  std::vector<uint32_t> indices{0, 2, 1, 0, 3, 2};

  static std::vector<float> corners(double low, double high) {
    const auto a = float(low), b = float(high);
    return {a, a, b, a, b, b, a, b};
  }
  void add_to(World& world, const kuafu_material_desc& material) const {
    kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
    mesh.positions = positions.data();
    mesh.uvs = uvs.empty() ? nullptr : uvs.data();
    mesh.uvs_1 = uvs_1.empty() ? nullptr : uvs_1.data();
    mesh.colors = colors.empty() ? nullptr : colors.data();
    mesh.indices = indices.data();
    mesh.vertex_count = 4;
    mesh.triangle_count = 2;
    uint32_t mesh_id = 0, material_id = 0, id = 0;
    ok(kuafu_scene_add_mesh(world.scene(), &mesh, &mesh_id));
    ok(kuafu_scene_add_material(world.scene(), &material, &material_id));
    kuafu_instance_desc instance = kuafu_instance_desc_init(mesh_id);
    instance.materials = &material_id;
    instance.material_count = 1;
    ok(kuafu_scene_add_instance(world.scene(), &instance, &id));
  }
};

constexpr uint32_t texture_width = 4, texture_height = 3;
const std::vector<uint8_t> texels{10, 40, 90, 250, 70, 130, 20, 160, 200, 5, 110, 220};

/// Texel i of `count`, wherever i is.
int wrapped(int i, int count, uint32_t wrap) {
  if (wrap == KUAFU_WRAP_CLAMP) return std::min(std::max(i, 0), count - 1);
  const int period = wrap == KUAFU_WRAP_MIRROR ? 2 * count : count, place = (i % period + period) % period;
  return place < count ? place : 2 * count - 1 - place;
}

double texel(int x, int y, const kuafu_texture_desc& t) {
  return texels[size_t(wrapped(y, texture_height, t.wrap_v)) * texture_width + size_t(wrapped(x, texture_width, t.wrap_u))] / 255.0;
}

double expected(double u, double v, const kuafu_texture_desc& t) {
  const double x = u * texture_width, y = v * texture_height;
  if (t.filter == KUAFU_FILTER_NEAREST) return texel(int(std::floor(x)), int(std::floor(y)), t);
  const double bx = std::floor(x - 0.5), by = std::floor(y - 0.5), fx = x - 0.5 - bx, fy = y - 0.5 - by;
  const int i = int(bx), j = int(by);
  return (texel(i, j, t) * (1 - fx) + texel(i + 1, j, t) * fx) * (1 - fy) +
         (texel(i, j + 1, t) * (1 - fx) + texel(i + 1, j + 1, t) * fx) * fy;
}

constexpr uint32_t image_size = 37;  // no pixel's centre lies between two texels
Pixels albedo(World& world) {
  world.desc().samples_per_pixel = 1;
  return world.render({view_at({0, 0, 0}, image_size, image_size, image_size / 2.0)}, {KUAFU_OUTPUT_ALBEDO})[KUAFU_OUTPUT_ALBEDO];
}

/// Texture coordinate of a pixel's centre.
double coordinate(uint32_t pixel, double low, double high) { return low + (high - low) * (pixel + 0.5) / image_size; }

class TextureLookup : public testing::TestWithParam<uint32_t> {};  // the tracer: its device has stages of its own

TEST_P(TextureLookup, every_wrap_and_filter_reads_the_texel_that_it_should) {
  SKIP_IF(why_not(GetParam()));
  constexpr double low = -1.62, high = 2.37;
  for (uint32_t wrap_u = 0; wrap_u < 3; ++wrap_u)
    for (uint32_t wrap_v = 0; wrap_v < 3; ++wrap_v)
      for (uint32_t filter = 0; filter < 2; ++filter) {
        World world(GetParam());
        kuafu_texture_desc t = texture_of(texels, texture_width);
        t.wrap_u = wrap_u, t.wrap_v = wrap_v, t.filter = filter;
        kuafu_material_desc m = lambert(1);
        m.base_color_texture = world.add_texture(t);
        Wall wall;
        wall.uvs = Wall::corners(low, high);
        wall.add_to(world, m);
        const Pixels image = albedo(world);
        for (uint32_t row = 0; row < image_size; row += 3)
          for (uint32_t column = 0; column < image_size; ++column)
            ASSERT_NEAR(image.at(0, row, column), expected(coordinate(column, low, high), coordinate(row, low, high), t), 2e-3)
                << "wrap " << wrap_u << wrap_v << " filter " << filter << " pixel " << row << " " << column;
      }
}

TEST_P(TextureLookup, the_second_set_and_a_transform_move_the_image_in_paths_too) {
  SKIP_IF(why_not(GetParam()));
  World world(GetParam());
  world.set_environment(1.0f);
  kuafu_texture_desc t = texture_of(texels, texture_width);
  t.wrap_u = KUAFU_WRAP_MIRROR, t.filter = KUAFU_FILTER_NEAREST, t.uv_set = 1;
  const float rows[6] = {0.3f, -0.8f, 0.1037f, 0.9f, 0.2f, -0.4f};  // no pixel's centre lies between two texels
  std::memcpy(t.uv_transform, rows, sizeof rows);
  kuafu_material_desc m = lambert(1);
  m.base_color_texture = world.add_texture(t);
  Wall wall;
  wall.uvs = Wall::corners(5, 6);
  wall.uvs_1 = Wall::corners(0, 1);
  wall.add_to(world, m);
  world.desc().samples_per_pixel = 4;
  auto images = world.render({view_at({0, 0, 0}, image_size, image_size, image_size / 2.0)}, {KUAFU_OUTPUT_ALBEDO, KUAFU_OUTPUT_RADIANCE});
  double sum = 0, radiance = images[KUAFU_OUTPUT_RADIANCE].mean();
  for (uint32_t row = 0; row < image_size; ++row)
    for (uint32_t column = 0; column < image_size; ++column) {
      const double u = coordinate(column, 0, 1), v = coordinate(row, 0, 1);
      const double want = expected(0.3 * u - 0.8 * v + 0.1037, 0.9 * u + 0.2 * v - 0.4, t);
      sum += want;
      EXPECT_NEAR(images[KUAFU_OUTPUT_ALBEDO].at(0, row, column), want, 2e-3);
    }
  EXPECT_NEAR(radiance, sum / (image_size * image_size), 0.01)
      << "a Lambertian surface in an even environment of 1 is as bright as its albedo";
}

TEST_P(TextureLookup, vertex_colours_multiply_and_infrared_takes_their_red) {
  SKIP_IF(why_not(GetParam()));
  for (const bool own_albedo : {false, true}) {
    World world(GetParam());
    kuafu_material_desc m = lambert(0.5f);
    if (own_albedo) m.ir_albedo = 0.25f;
    Wall wall;
    wall.colors = {0, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1};  // red grows with u
    wall.add_to(world, m);
    const Pixels infrared = albedo(world);
    kuafu_view_desc view = view_at({0, 0, 0}, image_size, image_size, image_size / 2.0);
    view.band = KUAFU_BAND_VISIBLE;
    const Pixels visible = world.render({view}, {KUAFU_OUTPUT_ALBEDO})[KUAFU_OUTPUT_ALBEDO];
    for (uint32_t column = 0; column < image_size; ++column) {
      const double red = 0.5 * coordinate(column, 0, 1);
      EXPECT_NEAR(infrared.at(0, 9, column), own_albedo ? 0.25 : red, 1e-5);
      EXPECT_NEAR(visible.at(0, 9, column, 0), red, 1e-5);
      EXPECT_NEAR(visible.at(0, 9, column, 1), 0.5, 1e-5);
      EXPECT_NEAR(visible.at(0, 9, column, 2), 0.0, 1e-5);
    }
  }
}

// The map's normal has x = y = 0.5 of z; scaled, its slope grows by as much. A transform that turns the image by a right angle turns the
// normal with it.
TEST_P(TextureLookup, normals_are_scaled_and_turn_with_the_image) {
  SKIP_IF(why_not(GetParam()));
  const std::vector<uint8_t> map{191, 128, 255};  // x = 0.5, z = 1
  for (const float scale : {0.0f, 1.0f, 2.0f})
    for (const bool turned : {false, true}) {
      World world(GetParam());
      kuafu_texture_desc t = texture_of(map, 1, 3);
      t.uv_set = turned ? 1 : 0;
      const float quarter[6] = {0, 1, 0, -1, 0, 0};  // u' = v, v' = -u
      if (turned) std::memcpy(t.uv_transform, quarter, sizeof quarter);
      kuafu_material_desc m = lambert(1);
      m.normal_texture = world.add_texture(t);
      m.normal_scale = scale;
      Wall wall;
      wall.uvs = Wall::corners(0, 0);
      wall.uvs_1 = wall.uvs;
      (turned ? wall.uvs_1 : wall.uvs) = Wall::corners(0, 1);
      wall.add_to(world, m);
      const Pixels normal = world.render({view_at({0, 0, 0}, 8, 8, 100)}, {KUAFU_OUTPUT_NORMAL})[KUAFU_OUTPUT_NORMAL];
      const double slope = (2 * 191 / 255.0 - 1) * scale, across = (2 * 128 / 255.0 - 1) * scale;
      const double length = std::sqrt(slope * slope + across * across + 1);
      const uint32_t along = turned ? 1 : 0;  // u' grows with v, which is the world's y
      EXPECT_NEAR(normal.at(0, 4, 4, along), slope / length, 1e-3) << "scale " << scale << " turned " << turned;
      EXPECT_NEAR(std::abs(normal.at(0, 4, 4, 1 - along)), across / length, 1e-3);
    }
}

TEST_P(TextureLookup, the_roughness_texture_also_makes_glass_rough_or_smooth) {
  SKIP_IF(why_not(GetParam()));
  const std::vector<uint8_t> smooth{255, 0, 255};  // roughness 0
  std::vector<float> images[3];                    // smooth, smooth by its texture, rough
  for (int i = 0; i < 3; ++i) {
    World world(GetParam());
    world.set_environment(0.2f);
    kuafu_material_desc m = glass(1.5f);
    m.roughness = m.transmission_roughness = i > 0 ? 0.6f : 0.0f;
    if (i == 1) m.metallic_roughness_texture = world.add_texture(texture_of(smooth, 1, 3));
    world.add(sphere(0.5, 16, true, {0, 0, 2}), m);
    world.add(quad({0.3, 0, 3}, {0.2, 0, 0}, {0, -0.2, 0}), emitter(5));
    world.desc().samples_per_pixel = 64;
    images[i] = world.radiance(view_at({0, 0, 0}, 24, 24, 40)).values;
  }
  const auto difference = [&](int i) {
    double sum = 0;
    for (size_t k = 0; k < images[0].size(); ++k) sum += std::abs(double(images[0][k]) - double(images[i][k]));
    return sum / double(images[0].size());
  };
  EXPECT_GT(difference(2), 0.05) << "roughness shows";
  EXPECT_LT(difference(1), 0.05 * difference(2));
}

// glTF's factors are 1 where a file has a texture alone: metal and rough by them, glass by the texture. Frosted glass reads its table of
// albedos then too, and light goes through where the texture is smooth.
TEST(TextureLookupOfGlass, whose_texture_takes_metal_and_roughness_away_finds_glass) {
  for (const uint8_t green : {0, 255}) {
    std::vector<float> images[2];  // by factors, by the texture
    for (int i = 0; i < 2; ++i) {
      World world;
      world.set_environment(0.2f);
      const std::vector<uint8_t> no_metal{255, green, 0};
      kuafu_material_desc m = glass(1.7f);
      m.roughness = m.transmission_roughness = i == 0 ? float(green) / 255 : 1.0f;
      if (i == 1) m.metallic = 1;
      if (i == 1) m.metallic_roughness_texture = world.add_texture(texture_of(no_metal, 1, 3));
      world.add(sphere(0.5, 16, true, {0, 0, 2}), m);
      world.add(quad({0, 0, 3}, {-2, 0, 0}, {0, 2, 0}), lambert(0.5f));
      world.add_point({0.3, 0, 0}, 5);
      world.desc().samples_per_pixel = 16;
      images[i] = world.radiance(view_at({0, 0, 0}, 24, 24, 30)).values;
    }
    for (size_t k = 0; k < images[0].size(); ++k) EXPECT_NEAR(images[0][k], images[1][k], 1e-3) << "green " << int(green);
  }
}

TEST_P(TextureLookup, a_light_ends_at_its_range) {
  SKIP_IF(why_not(GetParam()));
  for (const double range : {0.0, 2.0, 1.25, 0.9}) {
    World world(GetParam());
    world.add(quad({0, 0, 1}, {0.1, 0, 0}, {0, -0.1, 0}), lambert(1));
    kuafu_light_desc light = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
    light.ir_intensity = float(pi);
    light.range_m = range;
    world.add_light(light, placed({0, 0, 0}));
    const double ending = range == 0 ? 1 : std::max(0.0, 1 - std::pow(1 / range, 4));
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 9, 9, 500)).at(0, 4, 4), ending, 1e-3) << "range " << range;
  }
}

TEST(TextureLookupFields, wrong_values_are_refused) {
  World world;
  const auto refused = [&](auto&& change) {
    kuafu_texture_desc t = texture_of(texels, texture_width);
    change(t);
    uint32_t id = 0;
    EXPECT_EQ(kuafu_scene_add_texture(world.scene(), &t, &id), KS_ERROR_INVALID_ARGUMENT);
  };
  refused([](auto& t) { t.wrap_u = 3; });
  refused([](auto& t) { t.wrap_v = 9; });
  refused([](auto& t) { t.filter = 2; });
  refused([](auto& t) { t.uv_set = 2; });
  refused([](auto& t) { t.uv_transform[2] = NAN; });
}

INSTANTIATE_TEST_SUITE_P(Tracers, TextureLookup, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE));

}  // namespace
}  // namespace laws
