// SPDX-License-Identifier: Apache-2.0
// The benchmarks' scene, as plain data: a table with six boxes and thirty bumpy balls (102 k triangles, 37 instances) under one projector
// of random dots, in metres, z up. And the same as a kuafu scene.
#pragma once

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <glm/glm.hpp>
#include <numbers>
#include <random>
#include <vector>

#include "kuafu/kuafu.h"

namespace bench {

using Vec3 = glm::dvec3;
using Pose = std::array<double, 16>;  // row-major, local_to_world

inline void ok(ks_status status) {
  if (status == KS_OK) return;
  std::fprintf(stderr, "%s\n", kuafu_last_error());
  std::exit(1);
}

struct Shape {
  std::vector<float> positions, normals;
  std::vector<uint32_t> indices;
};

struct Placed {
  uint32_t shape, material;
  Pose local_to_world;
};

struct TableTop {
  std::vector<Shape> shapes;
  std::vector<kuafu_material_desc> materials;
  std::vector<Placed> instances;
  std::vector<uint8_t> pattern;  // [512][512]
  kuafu_light_desc projector = kuafu_light_desc_init(KUAFU_LIGHT_PROJECTOR);
};

inline constexpr uint32_t pattern_size = 512;

/// Looks from `eye` at `target`; +z forward, x right, y down.
inline Pose look_at(const Vec3& eye, const Vec3& target) {
  const Vec3 z = glm::normalize(target - eye), x = glm::normalize(glm::cross(z, Vec3{0, 0, 1})), y = glm::cross(z, x);
  return {x[0], y[0], z[0], eye[0], x[1], y[1], z[1], eye[1], x[2], y[2], z[2], eye[2], 0, 0, 0, 1};
}

inline Pose placed(const Vec3& at, double yaw, double scale) {
  const double c = scale * std::cos(yaw), s = scale * std::sin(yaw);
  return {c, -s, 0, at[0], s, c, 0, at[1], 0, 0, scale, at[2], 0, 0, 0, 1};
}

inline void add_quad(Shape& shape, const Vec3& centre, const Vec3& a, const Vec3& b) {
  const auto base = uint32_t(shape.positions.size() / 3);
  const Vec3 n = glm::normalize(glm::cross(a, b));
  for (const auto& [u, v] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
    const Vec3 p = centre + double(u) * a + double(v) * b;
    for (int i = 0; i < 3; ++i) shape.positions.push_back(float(p[i])), shape.normals.push_back(float(n[i]));
  }
  for (const uint32_t i : {0u, 1u, 2u, 0u, 2u, 3u}) shape.indices.push_back(base + i);
}

inline Shape box(const Vec3& half) {
  Shape shape;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      Vec3 centre{}, a{}, b{};
      centre[axis] = side * half[axis];
      a[(axis + 1) % 3] = half[(axis + 1) % 3];
      b[(axis + 2) % 3] = side * half[(axis + 2) % 3];
      add_quad(shape, centre, a, b);
    }
  return shape;
}

/// A sphere of radius about 1 with `bumps` of its surface; shared vertices, normals of the surface.
inline Shape ball(int rings, double bumps, double phase) {
  const auto point = [&](double theta, double phi) {
    const Vec3 d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
    const double r = 1 + bumps * std::sin(7 * d[0] + phase) * std::sin(6 * d[1] + 2 * phase) * std::sin(8 * d[2] + 3 * phase);
    return r * d;
  };
  Shape shape;
  const int columns = 2 * rings;
  const double step = 1e-4;
  for (int r = 0; r <= rings; ++r)
    for (int c = 0; c <= columns; ++c) {
      const double theta = std::numbers::pi * r / rings, phi = 2 * std::numbers::pi * (c % columns) / columns;
      const bool pole = r == 0 || r == rings;
      const Vec3 p = pole ? (r == 0 ? point(0, 0) : point(std::numbers::pi, 0)) : point(theta, phi);
      const Vec3 n = pole ? glm::normalize(p) : glm::normalize(glm::cross(point(theta + step, phi) - p, point(theta, phi + step) - p));
      for (int i = 0; i < 3; ++i) shape.positions.push_back(float(p[i])), shape.normals.push_back(float(n[i]));
    }
  for (int r = 0; r < rings; ++r)
    for (int c = 0; c < columns; ++c) {
      const auto i = uint32_t(r * (columns + 1) + c), down = i + uint32_t(columns) + 1;
      if (r > 0) shape.indices.insert(shape.indices.end(), {i, down, i + 1});
      if (r + 1 < rings) shape.indices.insert(shape.indices.end(), {i + 1, down, down + 1});
    }
  return shape;
}

enum class Surfaces { plastic, mixed };  // mixed: plastic, every third ball of metal, every fourth of glass

inline kuafu_material_desc surface(Surfaces kind, int index, std::mt19937& engine) {
  kuafu_material_desc m = kuafu_material_desc_init();
  for (int i = 0; i < 3; ++i) m.base_color[i] = 0.2f + 0.6f * float(engine() % 256) / 255.0f;
  m.roughness = 0.25f + 0.4f * float(engine() % 256) / 255.0f;
  if (kind != Surfaces::mixed || index < 7) return m;
  if (index % 3 == 0) m.metallic = 1;
  if (index % 3 != 0 && index % 4 == 0) m.transmission = 1, m.roughness = 0;
  return m;
}

inline TableTop table_top(Surfaces kind) {
  TableTop t;
  std::mt19937 engine(1);
  const auto add = [&](uint32_t shape, const Pose& pose) {
    t.materials.push_back(surface(kind, int(t.instances.size()), engine));
    t.instances.push_back({shape, uint32_t(t.materials.size() - 1), pose});
  };
  add_quad(t.shapes.emplace_back(), {0, 0, 0}, {5, 0, 0}, {0, 5, 0});
  add(0, placed({0, 0, 0}, 0, 1));
  t.shapes.push_back(box({0.5, 0.35, 0.4}));
  for (int i = 0; i < 6; ++i) add(1, placed({-2.6 + 1.05 * i, 2.3 - 0.25 * (i % 3), 0.4 * (1 - 0.08 * i)}, 0.5 * i, 1 - 0.08 * i));
  for (int i = 0; i < 20; ++i) {
    const double radius = 0.28 + 0.02 * (7 * i % 9);
    t.shapes.push_back(ball(36, 0.04, i + 1));
    add(uint32_t(2 + i), placed({-2.4 + 1.2 * (i % 5) + 0.1 * (i / 5), 1.4 - i / 5, radius}, 0.3 * i, radius));
  }
  for (int i = 0; i < 10; ++i)
    add(uint32_t(2 + 2 * i), placed({-2.2 + 0.48 * i, 0.9 - 0.35 * (i % 4), 1.05 + 0.1 * (i % 3)}, 1.3 * i, 0.16));

  t.pattern.assign(size_t(pattern_size) * pattern_size, 30);  // weak light everywhere, dots of 3x3 on it
  for (int i = 0; i < 6000; ++i) {
    const uint32_t x = engine() % (pattern_size - 3), y = engine() % (pattern_size - 3);
    for (uint32_t v = 0; v < 3; ++v) std::memset(&t.pattern[(y + v) * pattern_size + x], 255, 3);
  }
  const Pose from = look_at({2.2, -2.8, 6}, {0, 0.3, 0});
  std::memcpy(t.projector.light_to_world, from.data(), sizeof t.projector.light_to_world);
  const double focal = pattern_size / (2 * 0.55), centre = (pattern_size - 1) / 2.0;
  const double k[9] = {focal, 0, centre, 0, focal, centre, 0, 0, 1};
  std::memcpy(t.projector.k, k, sizeof k);
  for (float& i : t.projector.intensity) i = 60;
  t.projector.ir_intensity = 60;
  return t;
}

/// Camera `index` of `count` that stand around the table; the first is the front one.
inline kuafu_camera_desc camera(uint32_t width, uint32_t height, uint32_t index = 0, uint32_t count = 1) {
  kuafu_camera_desc c = kuafu_camera_desc_init();
  c.width = width, c.height = height;
  const double angle = 2 * std::numbers::pi * index / count, focal = height / (2 * std::tan(0.375));
  const double k[9] = {focal, 0, (width - 1) / 2.0, 0, focal, (height - 1) / 2.0, 0, 0, 1};
  std::memcpy(c.k, k, sizeof k);
  const Pose pose = look_at({5.6 * std::sin(angle), -5.6 * std::cos(angle), 3.4 + 0.5 * std::sin(3 * angle)}, {0, 0.2, 0.2});
  std::memcpy(c.camera_to_world, pose.data(), sizeof c.camera_to_world);
  return c;
}

inline uint32_t add_shape(kuafu_scene scene, const Shape& shape) {
  kuafu_mesh_desc d = kuafu_mesh_desc_init();
  d.positions = shape.positions.data();
  d.normals = shape.normals.data();
  d.indices = shape.indices.data();
  d.vertex_count = uint32_t(shape.positions.size() / 3);
  d.triangle_count = uint32_t(shape.indices.size() / 3);
  uint32_t id = 0;
  ok(kuafu_scene_add_mesh(scene, &d, &id));
  return id;
}

inline uint32_t add_instance(kuafu_scene scene, uint32_t mesh, uint32_t material, const Pose& pose,
                             uint32_t environment = KUAFU_ALL_ENVIRONMENTS) {
  kuafu_instance_desc d = kuafu_instance_desc_init(mesh);
  d.materials = &material;
  d.material_count = 1;
  d.environment = environment;
  std::memcpy(d.local_to_world, pose.data(), sizeof d.local_to_world);
  uint32_t id = 0;
  ok(kuafu_scene_add_instance(scene, &d, &id));
  return id;
}

/// The caller releases it.
inline kuafu_scene scene_of(const TableTop& t, kuafu_device device) {
  kuafu_scene scene = nullptr;
  ok(kuafu_scene_create(device, &scene));
  std::vector<uint32_t> meshes, materials;
  for (const Shape& shape : t.shapes) meshes.push_back(add_shape(scene, shape));
  for (const kuafu_material_desc& m : t.materials) ok(kuafu_scene_add_material(scene, &m, &materials.emplace_back()));
  for (const Placed& p : t.instances) add_instance(scene, meshes[p.shape], materials[p.material], p.local_to_world);
  kuafu_texture_desc texture = kuafu_texture_desc_init();
  texture.texels = t.pattern.data();
  texture.width = texture.height = pattern_size;
  texture.channels = 1;
  texture.format = KS_FORMAT_U8;
  kuafu_light_desc projector = t.projector;
  ok(kuafu_scene_add_texture(scene, &texture, &projector.texture));
  uint32_t light = 0;
  ok(kuafu_scene_add_light(scene, &projector, &light));
  return scene;
}

}  // namespace bench
