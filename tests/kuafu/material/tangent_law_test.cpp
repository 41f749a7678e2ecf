// SPDX-License-Identifier: Apache-2.0
// TANGENT of a glTF file: a map of normals follows it, and not the texture coordinates.
#include "kuafu/io/sample_files.h"
#include "kuafu/world.h"

namespace laws {
namespace {

using namespace scene_test;

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

struct Wall {
  double angle = 0;  // of the tangent from growing u, in radians, towards growing v
  float side = 1;    // w; 0: the file gives no TANGENT
  bool mirrored = false, turned_texture = false;
  Vec3 expected{};
};

/// Walls side by side that face the camera at the origin; u grows along x and v along y, which is down.
GltfWriter file_of(const std::vector<Wall>& walls) {
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
    const Wall& wall = walls[i];
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

void expect_normals(uint32_t tracer, const std::vector<Wall>& walls) {
  SKIP_IF(why_not(tracer));
  World world(tracer);
  const Folder folder;
  file_of(walls).write_glb(folder / "walls.glb");
  ok(kuafu_scene_load(world.scene(), (folder / "walls.glb").c_str(), nullptr, nullptr));
  const auto view = view_at({0, 0, 0}, wall_pixels * uint32_t(walls.size()), wall_pixels, wall_pixels * 50);
  const Pixels normal = world.render({view}, {KUAFU_OUTPUT_NORMAL})[KUAFU_OUTPUT_NORMAL];
  for (size_t i = 0; i < walls.size(); ++i)
    for (uint32_t c = 0; c < 3; ++c)
      EXPECT_NEAR(normal.at(0, 4, uint32_t(i) * wall_pixels + 4, c), walls[i].expected[c], 0.005) << "wall " << i << ", tracer " << tracer;
}

/// What glTF 2.0, section 3.7.2.1, says: bitangent = cross(normal, tangent) * w, and the pose is applied to all three.
Vec3 by_the_text(const Wall& wall) {
  const double tangent[2] = {std::cos(wall.angle), std::sin(wall.angle)};
  const double bitangent[2] = {wall.side * tangent[1], -wall.side * tangent[0]};  // cross((0, 0, -1), tangent) * w
  Vec3 n{across * tangent[0] + up * bitangent[0], across * tangent[1] + up * bitangent[1], -std::sqrt(1 - across * across - up * up)};
  if (wall.mirrored) n[0] = -n[0];
  return n;
}

TEST(Tangents, turn_a_map_of_normals_on_both_sides_in_mirrors_and_whatever_the_texture_does) {
  std::vector<Wall> walls;
  for (const bool mirrored : {false, true})
    for (const double angle : {0.0, pi / 2, pi})
      for (const float side : {1.0f, -1.0f}) walls.push_back({angle, side, mirrored});
  walls.push_back({pi / 2, 1, false, true});
  for (Wall& wall : walls) wall.expected = by_the_text(wall);
  for (const bool mirrored : {false, true}) {
    Wall none{0, 0, mirrored};
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
    world.desc().samples_per_pixel = 4;
    return world.radiance(view_at({0, 0, 0}, 4, 4, 20000)).mean();
  };
  const Vec3 right{80, 0, 0}, down{0, 80, 0};
  EXPECT_GT(seen(0, right), 3 * seen(pi / 2, right));
  EXPECT_NEAR(seen(pi / 2, down), seen(0, right), 0.02 * seen(0, right));
}

}  // namespace
}  // namespace laws
