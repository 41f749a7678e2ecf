// SPDX-License-Identifier: Apache-2.0
// Textures: where they are looked up, how they are filtered, what they turn.
#include "kuafu/io/sample_files.h"
#include "kuafu/world.h"

namespace laws {
namespace {

using namespace scene_test;

uint32_t add_texture(World& world, const std::vector<uint8_t>& texels, uint32_t width, uint32_t channels, bool srgb) {
  kuafu_texture_desc t = texture_of(texels, width, channels);
  t.srgb = srgb;
  return world.add_texture(t);
}

kuafu_view_desc visible_view(uint32_t size) {
  return visible(view_at({0, 0, 0}, size, size, size / 2.0));  // the wall fills the image
}

TEST(Textures, row_zero_is_at_the_top_and_colours_are_decoded) {
  World world;
  world.set_environment(1.0f);
  kuafu_material_desc m = lambert(1.0f);
  m.base_color[1] = 0.5f;
  // Red, green / blue, grey; each covers 64 x 64 pixels and is read at its centre.
  m.base_color_texture = add_texture(world, {255, 0, 0, 0, 255, 0, 0, 0, 255, 128, 128, 128}, 2, 3, true);
  world.add(uv_wall(), m);
  const Pixels image = world.radiance(visible_view(128));
  const double grey = 0.21586;  // of 128 / 255, IEC 61966-2-1
  const double expected[4][3] = {{1, 0, 0}, {0, 0.5, 0}, {0, 0, 1}, {grey, grey / 2, grey}};
  for (int i = 0; i < 4; ++i)  // texel centres lie on the corner between four pixels
    for (uint32_t c = 0; c < 3; ++c) {
      double mean = 0;
      for (const uint32_t row : {31u, 32u})
        for (const uint32_t column : {31u, 32u}) mean += image.at(0, row + (i / 2) * 64, column + (i % 2) * 64, c) / 4;
      EXPECT_NEAR(mean, expected[i][c], 0.04) << "texel " << i << " channel " << c;
    }
}

TEST(Textures, infrared_takes_red_unless_it_has_its_own_albedo) {
  for (const bool own : {false, true}) {
    World world;
    world.set_environment(1.0f);
    kuafu_material_desc m = lambert(1.0f);
    m.base_color_texture = add_texture(world, {102, 255, 255}, 1, 3, false);
    if (own) m.ir_albedo = 0.7f;
    world.add(uv_wall(), m);
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 100)).mean(), own ? 0.7 : 0.4, 1e-3);
  }
}

TEST(Textures, a_flat_normal_map_changes_nothing_and_a_tilted_one_turns_the_surface) {
  // Sun-like light far along the axis: a normal turned by 30 degrees receives cos 30 of it.
  for (const bool tilted : {false, true}) {
    World world;
    kuafu_material_desc m = lambert(1.0f);
    m.normal_texture = tilted ? add_texture(world, {191, 128, 238}, 1, 3, false) : add_texture(world, {128, 128, 255}, 1, 3, false);
    world.add(uv_wall(), m);
    world.add_point({0, 0, -999}, 1e6f * float(pi));
    world.desc().max_bounces = 0;
    auto images = world.render({view_at({0, 0, 0}, 8, 8, 100)}, {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_NORMAL});
    EXPECT_NEAR(images[KUAFU_OUTPUT_RADIANCE].mean(), tilted ? std::cos(pi / 6) : 1.0, 0.01);
    // Tangent x is along growing u, which is the world's +x here; the wall faces -z.
    EXPECT_NEAR(images[KUAFU_OUTPUT_NORMAL].at(0, 4, 4, 0), tilted ? 0.5 : 0.0, 0.01);
    EXPECT_NEAR(images[KUAFU_OUTPUT_NORMAL].at(0, 4, 4, 2), tilted ? -std::cos(pi / 6) : -1.0, 0.01);
  }
}

TEST(Textures, transmission_and_specular_maps_multiply_their_factors) {
  // Fully transmitting glass of index 1, switched off by its map, is the base alone; a specular map of 0 leaves Lambert.
  World world;
  world.set_environment(1.0f);
  kuafu_material_desc m = kuafu_material_desc_init();
  for (int i = 0; i < 3; ++i) m.base_color[i] = 0.5f;
  m.transmission = 1;
  m.transmission_texture = add_texture(world, {0}, 1, 1, false);
  m.specular_texture = add_texture(world, {255, 255, 255, 0}, 1, 4, false);
  world.add(uv_wall(), m);
  for (const float v : world.radiance(view_at({0, 0, 0}, 8, 8, 100)).values) ASSERT_NEAR(v, 0.5f, 1e-3);
}

/// Texture coordinates of that wall, from `low` at the upper left to `high` at the lower right.
std::vector<float> corners(double low, double high) {
  const auto a = float(low), b = float(high);
  return {a, a, b, a, b, b, a, b};
}

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
  return world.image(view_at({0, 0, 0}, image_size, image_size, image_size / 2.0), KUAFU_OUTPUT_ALBEDO);
}

/// Texture coordinate of a pixel's centre.
double coordinate(uint32_t pixel, double low, double high) { return low + (high - low) * (pixel + 0.5) / image_size; }

/// The tracer: its device has stages of its own.
class TextureLookup : public testing::TestWithParam<uint32_t> {
 protected:
  void SetUp() override { SKIP_IF(why_not(GetParam())); }
};

TEST_P(TextureLookup, every_wrap_and_filter_reads_the_texel_that_it_should) {
  constexpr double low = -1.62, high = 2.37;
  for (uint32_t wrap_u = 0; wrap_u < 3; ++wrap_u)
    for (uint32_t wrap_v = 0; wrap_v < 3; ++wrap_v)
      for (uint32_t filter = 0; filter < 2; ++filter) {
        World world(GetParam());
        kuafu_texture_desc t = texture_of(texels, texture_width);
        t.wrap_u = wrap_u, t.wrap_v = wrap_v, t.filter = filter;
        kuafu_material_desc m = lambert(1);
        m.base_color_texture = world.add_texture(t);
        Shape shape = uv_wall();
        shape.uvs = corners(low, high);
        world.add(shape, m);
        const Pixels image = albedo(world);
        for (uint32_t row = 0; row < image_size; row += 3)
          for (uint32_t column = 0; column < image_size; ++column)
            ASSERT_NEAR(image.at(0, row, column), expected(coordinate(column, low, high), coordinate(row, low, high), t), 2e-3)
                << "wrap " << wrap_u << wrap_v << " filter " << filter << " pixel " << row << " " << column;
      }
}

TEST_P(TextureLookup, the_second_set_and_a_transform_move_the_image_in_paths_too) {
  World world(GetParam());
  world.set_environment(1.0f);
  kuafu_texture_desc t = texture_of(texels, texture_width);
  t.wrap_u = KUAFU_WRAP_MIRROR, t.filter = KUAFU_FILTER_NEAREST, t.uv_set = 1;
  const float rows[6] = {0.3f, -0.8f, 0.1037f, 0.9f, 0.2f, -0.4f};  // no pixel's centre lies between two texels
  std::memcpy(t.uv_transform, rows, sizeof rows);
  kuafu_material_desc m = lambert(1);
  m.base_color_texture = world.add_texture(t);
  Shape shape = uv_wall();
  shape.uvs = corners(5, 6);
  shape.uvs_1 = corners(0, 1);
  world.add(shape, m);
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
  for (const bool own_albedo : {false, true}) {
    World world(GetParam());
    kuafu_material_desc m = lambert(0.5f);
    if (own_albedo) m.ir_albedo = 0.25f;
    Shape shape = uv_wall();
    shape.colors = {0, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1};  // red grows with u
    world.add(shape, m);
    const Pixels infrared = albedo(world);
    const Pixels visible = world.image(visible_view(image_size), KUAFU_OUTPUT_ALBEDO);
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
      Shape shape = uv_wall();
      shape.uvs = shape.uvs_1 = corners(0, 0);
      (turned ? shape.uvs_1 : shape.uvs) = corners(0, 1);
      world.add(shape, m);
      const Pixels normal = world.image(view_at({0, 0, 0}, 8, 8, 100), KUAFU_OUTPUT_NORMAL);
      const double slope = (2 * 191 / 255.0 - 1) * scale, across = (2 * 128 / 255.0 - 1) * scale;
      const double length = std::sqrt(slope * slope + across * across + 1);
      const uint32_t along = turned ? 1 : 0;  // u' grows with v, which is the world's y
      EXPECT_NEAR(normal.at(0, 4, 4, along), slope / length, 1e-3) << "scale " << scale << " turned " << turned;
      EXPECT_NEAR(std::abs(normal.at(0, 4, 4, 1 - along)), across / length, 1e-3);
    }
}

TEST_P(TextureLookup, the_roughness_texture_also_makes_glass_rough_or_smooth) {
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
    images[i] = world.radiance(view_at({0, 0, 0}, 24, 24, 40), 64).values;
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
      images[i] = world.radiance(view_at({0, 0, 0}, 24, 24, 30), 16).values;
    }
    for (size_t k = 0; k < images[0].size(); ++k) EXPECT_NEAR(images[0][k], images[1][k], 1e-3) << "green " << int(green);
  }
}

TEST_P(TextureLookup, a_light_ends_at_its_range) {
  for (const double range : {0.0, 2.0, 1.25, 0.9}) {
    World world(GetParam());
    world.add(quad({0, 0, 1}, {0.1, 0, 0}, {0, -0.1, 0}), lambert(1));
    kuafu_light_desc light = light_of(KUAFU_LIGHT_POINT, float(pi));
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

constexpr double across = 0.5, up = 0.3;  // of the map's normal, along tangent and bitangent
constexpr uint32_t wall_pixels = 8;

/// A BMP of one texel that is that normal.
std::string tilted_normal() {
  std::string out("BM", 2);
  const auto word = [&](uint32_t value) { out.append(reinterpret_cast<const char*>(&value), 4); };
  for (const uint32_t value : {58u, 0u, 54u, 40u, 1u, 1u, 1u | 24u << 16, 0u, 4u, 0u, 0u, 0u, 0u}) word(value);
  const double ahead = std::sqrt(1 - across * across - up * up);
  for (const double part : {ahead, up, across}) out.push_back(char(std::lround((part + 1) / 2 * 255)));  // blue first
  return out + '\0';
}

struct TangentWall {
  double angle = 0;  // of the tangent from growing u, in radians, towards growing v
  float side = 1;    // w; 0: the file gives no TANGENT
  bool mirrored = false, turned_texture = false;
  Vec3 expected{};
};

/// Walls side by side that face the camera at the origin; u grows along x and v along y, which is down.
GltfWriter file_of(const std::vector<TangentWall>& walls) {
  GltfWriter w;
  const std::string bmp = tilted_normal();
  w.root["images"] = {{{"bufferView", w.view(bmp.data(), bmp.size())}, {"mimeType", "image/bmp"}}};
  w.root["textures"] = {{{"source", 0}}};
  json turned = {{"index", 0}, {"extensions", {{"KHR_texture_transform", {{"rotation", pi / 2}}}}}};
  w.root["materials"] = {{{"normalTexture", {{"index", 0}}}}, {{"normalTexture", std::move(turned)}}};
  const int positions = w.accessor<float>({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, type_float, "VEC3", 3),
            normals = w.accessor<float>({0, 0, -1, 0, 0, -1, 0, 0, -1, 0, 0, -1}, type_float, "VEC3", 3),
            uvs = w.accessor<float>({0, 0, 1, 0, 1, 1, 0, 1}, type_float, "VEC2", 2),
            indices = w.accessor<uint16_t>({0, 2, 1, 0, 3, 2}, type_u16, "SCALAR", 1);
  for (size_t i = 0; i < walls.size(); ++i) {
    const TangentWall& wall = walls[i];
    json attributes = {{"POSITION", positions}, {"NORMAL", normals}, {"TEXCOORD_0", uvs}};
    std::vector<float> tangents;
    for (int k = 0; k < 4; ++k) tangents.insert(tangents.end(), {float(std::cos(wall.angle)), float(std::sin(wall.angle)), 0, wall.side});
    if (wall.side != 0) attributes["TANGENT"] = w.accessor<float>(tangents, type_float, "VEC4", 4);
    const int mesh = w.mesh({{{"attributes", attributes}, {"indices", indices}, {"material", wall.turned_texture ? 1 : 0}}});
    const double x = 2 * double(i) - double(walls.size() - 1);
    w.node({{"mesh", mesh}, {"translation", {x, 0, 100}}, {"scale", {wall.mirrored ? -1 : 1, 1, 1}}});
  }
  return w;
}

void expect_normals(uint32_t tracer, const std::vector<TangentWall>& walls) {
  SKIP_IF(why_not(tracer));
  World world(tracer);
  const Folder folder;
  file_of(walls).write_glb(folder / "walls.glb");
  ok(kuafu_scene_load(world.scene(), (folder / "walls.glb").c_str(), nullptr, nullptr));
  const auto view = view_at({0, 0, 0}, wall_pixels * uint32_t(walls.size()), wall_pixels, wall_pixels * 50);
  const Pixels normal = world.image(view, KUAFU_OUTPUT_NORMAL);
  for (size_t i = 0; i < walls.size(); ++i)
    for (uint32_t c = 0; c < 3; ++c)
      EXPECT_NEAR(normal.at(0, 4, uint32_t(i) * wall_pixels + 4, c), walls[i].expected[c], 0.005) << "wall " << i << ", tracer " << tracer;
}

/// What glTF 2.0, section 3.7.2.1, says: bitangent = cross(normal, tangent) * w, and the pose is applied to all three.
Vec3 by_the_text(const TangentWall& wall) {
  const double tangent[2] = {std::cos(wall.angle), std::sin(wall.angle)};
  const double bitangent[2] = {wall.side * tangent[1], -wall.side * tangent[0]};  // cross((0, 0, -1), tangent) * w
  Vec3 n{across * tangent[0] + up * bitangent[0], across * tangent[1] + up * bitangent[1], -std::sqrt(1 - across * across - up * up)};
  if (wall.mirrored) n[0] = -n[0];
  return n;
}

TEST(Tangents, turn_a_map_of_normals_on_both_sides_in_mirrors_and_whatever_the_texture_does) {
  std::vector<TangentWall> walls;
  for (const bool mirrored : {false, true})
    for (const double angle : {0.0, pi / 2, pi})
      for (const float side : {1.0f, -1.0f}) walls.push_back({angle, side, mirrored});
  walls.push_back({pi / 2, 1, false, true});
  for (TangentWall& wall : walls) wall.expected = by_the_text(wall);
  for (const bool mirrored : {false, true}) {
    TangentWall none{0, 0, mirrored};
    none.expected = by_the_text({0, 1, mirrored});  // where u and v grow, as the first wall's tangents lie
    walls.push_back(none);
  }
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) expect_normals(tracer, walls);
}

// A lobe that is long along the tangent spreads the light of a lamp which stands that way.
TEST(Tangents, turn_brushed_metal) {
  const auto seen = [](double angle, const Vec3& lamp) {
    World world;
    GltfWriter w = file_of({{angle, 1}});
    w.root["materials"][0] = {{"pbrMetallicRoughness", {{"metallicFactor", 1}, {"roughnessFactor", 0.3}}},
                              {"extensions", {{"KHR_materials_anisotropy", {{"anisotropyStrength", 0.8}}}}}};
    const Folder folder;
    w.write_glb(folder / "wall.glb");
    ok(kuafu_scene_load(world.scene(), (folder / "wall.glb").c_str(), nullptr, nullptr));
    world.add_point(lamp, 1e4f);
    return world.radiance(view_at({0, 0, 0}, 4, 4, 20000), 4).mean();
  };
  const Vec3 right{80, 0, 0}, down{0, 80, 0};
  EXPECT_GT(seen(0, right), 3 * seen(pi / 2, right));
  EXPECT_NEAR(seen(pi / 2, down), seen(0, right), 0.02 * seen(0, right));
}

}  // namespace
}  // namespace laws
