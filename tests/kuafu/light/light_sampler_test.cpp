// SPDX-License-Identifier: Apache-2.0
// Every light's sampler against its density, on the shaders' text compiled as C++ and the tables that the host makes: chi-square over the
// sphere of directions, and the same density where a ray meets the light.
#include <gtest/gtest.h>

#include <functional>
#include <random>
#include <vector>

#include "frame/host_language.h"
#include "kuafu/material/chi_square.h"
#include "light/light_table.h"
#include "material/material_record.h"
#include "material/texels.h"

#define KUAFU_CHANNELS 1
namespace kuafu {
namespace {

constexpr uint features = ~0u;
#include "lib/shading.glsl"

using test::ChiSquare;

void chi_square(const std::function<vec3(vec2)>& sample, const std::function<double(vec3)>& density) {
  ChiSquare drawn;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(0.0f, 0.9999999f);
  for (int i = 0; i < ChiSquare::samples; ++i) drawn.count(sample(vec2(unit(random), unit(random))));
  EXPECT_NEAR(drawn.expect(density, 2e-5), 1, 0.01) << "the density's integral";
}

/// One light of a scene as the shaders see it.
struct Lit {
  LightTable table;
  std::vector<Texels> texels;
  std::vector<TextureRecord> textures;
  SceneAddresses addresses{};

  explicit Lit(const Scene& scene) {
    table = make_light_table(
        scene, Band{true, 0.05f, 0.0f}, 1, [](const Light&) { return PatternAddress{}; }, TimeSpan{});
    for (const auto& t : scene.textures()) texels.push_back(linear_texels(*t));
    for (size_t i = 0; i < texels.size(); ++i)
      textures.push_back({reinterpret_cast<uint64_t>(texels[i].words.data()), scene.textures()[uint32_t(i)].width,
                          scene.textures()[uint32_t(i)].height, texels[i].format, 0});
    addresses.textures.at = textures.data();
    addresses.lights.at = table.lights.data();
    addresses.light_shapes.at = table.shapes.data();
    addresses.light_cumulative.at = table.cumulative.data();
    addresses.light_triangles.at = table.triangles.data();
  }
  [[nodiscard]] LightSample sample(vec3 position, vec2 u) const {
    return sample_light(addresses, table.lights[0], table.shapes[0], position, u, 0.0f);
  }
  [[nodiscard]] ShapeHit meet(vec3 position, vec3 d) const { return meet_light(addresses, table.lights[0], table.shapes[0], position, d); }
};

void check_met(const Lit& lit, vec3 position) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(0.0f, 0.9999999f);
  for (int i = 0; i < 1000; ++i) {
    const LightSample l = lit.sample(position, vec2(unit(random), unit(random)));
    ASSERT_NEAR(length(l.direction), 1.0f, 1e-4f);
    const ShapeHit hit = lit.meet(position, l.direction);
    if (!hit.found) continue;  // a sample of the very edge
    ASSERT_NEAR(hit.pdf / l.pdf, 1, 2e-3);
    ASSERT_NEAR(l.irradiance * l.pdf, hit.radiance, 2e-3f * hit.radiance);
  }
  chi_square([&](vec2 u) { return lit.sample(position, u).direction; },
             [&](vec3 d) {
               const ShapeHit hit = lit.meet(position, d);
               return hit.found ? double(hit.pdf) : 0.0;
             });
}

/// A light, and a place that it lights.
struct At {
  Light light;
  vec3 position;
};

TEST(LightSampler, shapes) {
  using Kind = Light::Kind;
  for (const At& at : {At{{{.kind = Kind::rectangle, .ir_intensity = 2, .size_m = {1.2, 0.7}}}, {0.2f, -0.1f, 0.4f}},
                       {{{.kind = Kind::disk, .ir_intensity = 2, .radius_m = 0.6}}, {0.5f, 0.2f, 0.3f}},
                       {{{.kind = Kind::point, .ir_intensity = 2, .radius_m = 0.5}}, {0.3f, 0.2f, -0.6f}},
                       {{{.kind = Kind::directional, .ir_intensity = 2, .angle_rad = 0.9}}, {0, 0, 0}}}) {
    SCOPED_TRACE(int(at.light.kind));
    Scene scene;
    scene.add_light(at.light);
    check_met(Lit(scene), at.position);
  }
}

TEST(LightSampler, environment_map) {
  Scene scene;
  Texture map;
  map.width = 16, map.height = 8, map.channels = 1;
  std::mt19937 random(5);
  for (int i = 0; i < 128; ++i) map.texels.push_back(uint8_t(20 + random() % 230));
  Environment environment;
  environment.texture = scene.add_texture(map);
  environment.ir_radiance = 1;
  scene.set_environment(environment);
  const Lit lit(scene);
  chi_square([&](vec2 u) { return lit.sample(vec3(0.0f), u).direction; }, [&](vec3 d) { return double(lit.meet(vec3(0.0f), d).pdf); });
}

// Two shining triangles of different materials in one mesh, apart from each other as seen from the origin.
TEST(LightSampler, emissive_mesh) {
  Scene scene;
  Mesh mesh;
  mesh.positions = {{-1, -1, 1}, {1, -1, 1}, {0, 1, 1.5}, {-1, -1, -1}, {1, -1, -1}, {0, 0.5f, -0.7f}};
  mesh.indices = {{0, 1, 2}, {3, 4, 5}};
  mesh.slots = {0, 1};
  Material materials[2];
  materials[0].ir_emission = 1, materials[1].ir_emission = 3;
  Instance instance;
  instance.mesh = scene.add_mesh(mesh);
  for (const Material& m : materials) instance.materials.push_back(scene.add_material(m));
  scene.add_instance(instance);
  Lit lit(scene);
  std::vector<MaterialRecord> records;
  for (uint32_t i = 0; i < 2; ++i) records.push_back(material_record(materials[i], i, Band{true, 0.05f, 0.0f}, {}));
  const std::vector<uint32_t> slots{0, 1, 1};
  InstanceRecord r{};
  r.positions.at = mesh.positions.data();
  r.indices.at = mesh.indices.data();
  r.slots.at = const_cast<uint32_t*>(mesh.slots.data());
  r.flags = instance_has_slots;
  r.material_count = 2;
  for (int i = 0; i < 3; ++i) {
    r.local_to_world[i] = vec4(0.0f);
    r.local_to_world[i][i] = 1;
    r.normal_to_world[i] = vec3(0.0f);
    r.normal_to_world[i][i] = 1;
  }
  lit.addresses.instances.at = &r;
  lit.addresses.materials.at = records.data();
  lit.addresses.instance_materials.at = const_cast<uint32_t*>(slots.data());
  const auto density = [&](vec3 d) {
    for (uint32_t i = 0; i < 2; ++i) {
      const dvec3 a = mesh.positions[3 * i], e1 = dvec3(mesh.positions[3 * i + 1]) - a, e2 = dvec3(mesh.positions[3 * i + 2]) - a;
      const dvec3 n = cross(e1, e2), p = cross(dvec3(d), e2);  // Moeller and Trumbore 1997
      const double det = dot(e1, p), u = dot(-a, p) / det, v = dot(dvec3(d), cross(-a, e1)) / det, t = dot(e2, cross(-a, e1)) / det;
      if (u < 0 || v < 0 || u + v > 1 || t <= 0) continue;
      return double(mesh_pdf(records[i], lit.table.shapes[0], float(t), float(dot(normalize(n), dvec3(d)))));
    }
    return 0.0;
  };
  chi_square([&](vec2 u) { return lit.sample(vec3(0.0f), u).direction; }, density);
}

TEST(MediumSampler, phase) {
  for (const float g : {-0.6f, 0.0f, 0.3f, 0.85f}) {
    chi_square([&](vec2 u) { return sample_phase(g, u); }, [&](vec3 d) { return double(phase(g, d.z)); });
    double mean = 0;
    for (int i = 0; i < 100000; ++i) mean += double(sample_phase(g, vec2((float(i) + 0.5f) / 100000, 0.3f)).z) / 100000;
    EXPECT_NEAR(mean, g, 1e-3) << "Henyey and Greenstein's mean cosine";
  }
}

// Flights: by the density of scattering in the first `length`, whose integral is the weight.
TEST(MediumSampler, flight) {
  MediumRecord m{};
  m.extinction = vec3(1.3f);
  m.albedo = vec3(0.6f);
  for (const float length : {0.01f, 2.0f, 50.0f}) {
    const double all = 1 - std::exp(-1.3 * double(length));
    std::vector<double> counts(20);
    for (int i = 0; i < ChiSquare::samples; ++i) {
      const Flight f = sample_flight(m, length, vec2((float(i) + 0.5f) / ChiSquare::samples, 0.5f));
      ASSERT_NEAR(f.weight, 0.6 * all, 1e-3 * all);
      const double share = (1 - std::exp(-1.3 * double(f.t))) / all;  // uniform where t has its density
      counts[size_t(std::min(19, int(share * 20)))] += 1;
    }
    for (const double c : counts) EXPECT_NEAR(c, ChiSquare::samples / 20.0, 60) << length;
  }
}

}  // namespace
}  // namespace kuafu
