// SPDX-License-Identifier: Apache-2.0
// A Cornell-like room against a path tracer of its own: double precision, every triangle tried in turn, light from samples of the lamp
// alone.
#include <random>

#include "kuafu/world.h"

namespace laws {
namespace {

Vec3 operator+(const Vec3& a, const Vec3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Vec3 operator-(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Vec3 operator*(const Vec3& a, double s) { return {a[0] * s, a[1] * s, a[2] * s}; }
double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vec3 cross(const Vec3& a, const Vec3& b) { return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}; }
Vec3 unit(const Vec3& a) { return a * (1 / std::sqrt(dot(a, a))); }

struct Triangle {
  Vec3 a, e1, e2, normal;
  double albedo, emission;
};

struct Hit {
  double t = 1e30;
  const Triangle* triangle = nullptr;
};

class Room {
 public:
  void add(World& world, const Shape& shape, double albedo, double emission = 0) {
    kuafu_material_desc m = lambert(float(albedo));
    m.ir_emission = float(emission);
    world.add(shape, m);
    for (size_t i = 0; i < shape.indices.size(); i += 3) {
      Vec3 p[3];
      for (size_t k = 0; k < 3; ++k)
        for (size_t c = 0; c < 3; ++c) p[k][c] = double(shape.positions[3 * shape.indices[i + k] + c]);
      const Vec3 e1 = p[1] - p[0], e2 = p[2] - p[0];
      triangles_.push_back({p[0], e1, e2, unit(cross(e1, e2)), albedo, emission});
    }
  }

  /// Radiance along a ray: emission where the eye looks, and light of the lamp on bounces + 1 surfaces.
  double radiance(Vec3 origin, Vec3 direction, int bounces) {
    double sum = 0, throughput = 1;
    for (int bounce = 0; bounce <= bounces; ++bounce) {
      const Hit hit = closest(origin, direction);
      if (hit.triangle == nullptr) break;
      if (bounce == 0) sum += hit.triangle->emission;
      const Vec3 n = dot(hit.triangle->normal, direction) < 0 ? hit.triangle->normal : hit.triangle->normal * -1;
      origin = origin + direction * hit.t + n * 1e-9;
      throughput *= hit.triangle->albedo;
      sum += throughput / pi * irradiance(origin, n);
      direction = cosine_around(n);
    }
    return sum;
  }

 private:
  double random() { return uniform_(random_); }

  [[nodiscard]] Hit closest(const Vec3& origin, const Vec3& direction) const {
    Hit hit;
    for (const Triangle& t : triangles_) {  // Moeller and Trumbore 1997
      const Vec3 p = cross(direction, t.e2), s = origin - t.a, q = cross(s, t.e1);
      const double det = dot(t.e1, p), u = dot(s, p) / det, v = dot(direction, q) / det, way = dot(t.e2, q) / det;
      if (u >= 0 && v >= 0 && u + v <= 1 && way > 1e-9 && way < hit.t) hit = {way, &t};
    }
    return hit;
  }

  double irradiance(const Vec3& point, const Vec3& n) {
    double sum = 0;
    for (const Triangle& t : triangles_) {
      if (t.emission == 0) continue;
      const double root = std::sqrt(random()), v = random() * root;
      const Vec3 way = t.a + t.e1 * (1 - root) + t.e2 * v - point, d = unit(way);
      const double cos_here = dot(d, n), area = 0.5 * std::sqrt(dot(cross(t.e1, t.e2), cross(t.e1, t.e2)));
      if (cos_here <= 0 || closest(point, d).triangle != &t) continue;
      sum += t.emission * cos_here * std::abs(dot(d, t.normal)) * area / dot(way, way);
    }
    return sum;
  }

  Vec3 cosine_around(const Vec3& n) {
    const double phi = 2 * pi * random(), r2 = random(), r = std::sqrt(r2);
    const Vec3 x = unit(cross(std::abs(n[0]) > 0.5 ? Vec3{0, 1, 0} : Vec3{1, 0, 0}, n)), y = cross(n, x);
    return x * (r * std::cos(phi)) + y * (r * std::sin(phi)) + n * std::sqrt(1 - r2);
  }

  std::vector<Triangle> triangles_;
  std::mt19937_64 random_{11};
  std::uniform_real_distribution<double> uniform_{0, 1};
};

TEST(Cornell, mean_radiance_is_that_of_another_path_tracer) {
  World world;
  Room room;
  room.add(world, quad({0, 1, 2}, {1, 0, 0}, {0, 0, 1}), 0.7);
  room.add(world, quad({0, -1, 2}, {1, 0, 0}, {0, 0, 1}), 0.7);
  room.add(world, quad({0, 0, 3}, {1, 0, 0}, {0, 1, 0}), 0.7);
  room.add(world, quad({-1, 0, 2}, {0, 1, 0}, {0, 0, 1}), 0.2);
  room.add(world, quad({1, 0, 2}, {0, 1, 0}, {0, 0, 1}), 0.45);
  room.add(world, box({0.25, 0.25, 0.25}, {0.4, 0.74, 1.7}), 0.6);
  room.add(world, box({0.25, 0.55, 0.25}, {-0.35, 0.44, 2.3}), 0.6);
  room.add(world, quad({0, -0.7, 2}, {0.3, 0, 0}, {0, 0, 0.3}), 0.3, 5);
  constexpr uint32_t size = 16, bounces = 5;
  constexpr double focal_px = 12;
  world.desc().samples_per_pixel = 1024;
  world.desc().max_bounces = bounces;
  const Pixels image = world.radiance(view_at({0, 0, -0.5}, size, size, focal_px));
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  constexpr int paths = 800;
  double expected[2] = {}, seen[2] = {};  // upper and lower half
  for (uint32_t r = 0; r < size; ++r)
    for (uint32_t c = 0; c < size; ++c) {
      double sum = 0;
      for (int i = 0; i < paths; ++i) {
        const double x = c + uniform(random) - (size - 1) / 2.0, y = r + uniform(random) - (size - 1) / 2.0;
        sum += room.radiance({0, 0, -0.5}, unit({x / focal_px, y / focal_px, 1}), bounces);
      }
      expected[2 * r / size] += sum / paths;
      seen[2 * r / size] += double(image.at(0, r, c));
    }
  for (int half : {0, 1}) EXPECT_NEAR(seen[half] / expected[half], 1, 0.015) << half;
}

}  // namespace
}  // namespace laws
