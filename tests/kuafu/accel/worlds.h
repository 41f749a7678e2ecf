// SPDX-License-Identifier: Apache-2.0
// Scenes and rays for the tracers' tests, by numbers straight from a Mersenne twister: every standard library gives the same.
#pragma once

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <random>
#include <vector>

#include "kuafu/accel/ray_bench.h"

namespace kuafu::test {

class Random {
 public:
  explicit Random(uint32_t seed) : engine_(seed) {}
  double uniform(double low = 0.0, double high = 1.0) { return low + (high - low) * (double(engine_()) / 4294967296.0); }
  uint32_t below(uint32_t count) { return uint32_t(uniform(0.0, double(count))); }
  glm::dvec3 in_cube(double half) {
    const double x = uniform(-half, half), y = uniform(-half, half), z = uniform(-half, half);
    return {x, y, z};
  }
  glm::dvec3 direction() {
    for (;;) {
      const glm::dvec3 p = in_cube(1.0);
      const double length = glm::length(p);
      if (length > 0.1 && length <= 1.0) return p / length;
    }
  }

 private:
  std::mt19937 engine_;
};

inline Mesh soup(Random& random, uint32_t triangles, double edge) {
  Mesh mesh;
  for (uint32_t i = 0; i < triangles; ++i) {
    const glm::dvec3 centre = random.in_cube(1.0);
    for (int corner = 0; corner < 3; ++corner) mesh.positions.emplace_back(centre + random.in_cube(edge));
    mesh.indices.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
  }
  return mesh;
}

/// Closed unit sphere of rings x 2 rings quads, with shared vertices.
inline Mesh sphere(uint32_t rings) {
  Mesh mesh;
  const uint32_t columns = 2 * rings;
  for (uint32_t r = 0; r <= rings; ++r)
    for (uint32_t c = 0; c < columns; ++c) {
      const double theta = M_PI * r / rings, phi = 2.0 * M_PI * c / columns;
      const bool pole = r == 0 || r == rings;
      mesh.positions.emplace_back(pole ? 0.0 : std::sin(theta) * std::cos(phi), pole ? 0.0 : std::sin(theta) * std::sin(phi),
                                  std::cos(theta));
    }
  for (uint32_t r = 0; r < rings; ++r)
    for (uint32_t c = 0; c < columns; ++c) {
      const uint32_t a = r * columns + c, b = r * columns + (c + 1) % columns;
      mesh.indices.emplace_back(a, a + columns, b);
      mesh.indices.emplace_back(b, a + columns, b + columns);
    }
  return mesh;
}

inline Instance place(uint32_t mesh, const glm::dmat4& local_to_world = glm::dmat4(1.0), uint32_t environment = none) {
  Instance instance;
  instance.mesh = mesh;
  instance.environment = environment;
  instance.local_to_world = local_to_world;
  return instance;
}

inline glm::dmat4 pose(const glm::dvec3& at, const glm::dvec3& scale = glm::dvec3(1.0), double angle = 0.0,
                       const glm::dvec3& axis = {0.0, 0.0, 1.0}) {
  return glm::scale(glm::rotate(glm::translate(glm::dmat4(1.0), at), angle, axis), scale);
}

/// Rotated, mirrored and stretched by up to 1:6.
inline glm::dmat4 random_pose(Random& random, double spread) {
  glm::dvec3 scale;
  for (int axis = 0; axis < 3; ++axis) scale[axis] = random.uniform(0.25, 1.5) * (random.uniform() < 0.3 ? -1.0 : 1.0);
  const double angle = random.uniform(0.0, 6.28);
  return pose(random.in_cube(spread), scale, angle, random.direction());
}

/// Several meshes, each placed several times.
inline Scene instanced_world(uint32_t seed, uint32_t instances, double spread) {
  Random random(seed);
  Scene scene;
  const uint32_t meshes[] = {scene.add_mesh(soup(random, 60, 0.3)), scene.add_mesh(sphere(6)), scene.add_mesh(soup(random, 3, 0.8))};
  for (uint32_t i = 0; i < instances; ++i) scene.add_instance(place(meshes[i % 3], random_pose(random, spread)));
  return scene;
}

/// Every vertex moves by up to `reach` along each axis.
inline void shake(Scene& scene, uint32_t mesh, Random& random, double reach) {
  std::vector<glm::vec3> positions = scene.meshes()[mesh].positions;
  for (glm::vec3& position : positions) position += glm::vec3(random.in_cube(reach));
  scene.update_mesh_positions(mesh, std::move(positions), {});
}

/// From anywhere in a cube, anywhere to.
inline std::vector<TestRay> random_rays(uint32_t seed, uint32_t count, double half) {
  Random random(seed);
  std::vector<TestRay> rays(count);
  for (TestRay& ray : rays) {
    ray.origin = random.in_cube(half);
    ray.direction = glm::normalize(glm::vec3(random.direction()));
  }
  return rays;
}

/// A pinhole camera that looks along z over 90 degrees: size x size rays, row by row.
inline std::vector<TestRay> camera_rays(uint32_t size, const glm::vec3& origin) {
  std::vector<TestRay> rays(size_t(size) * size);
  for (uint32_t i = 0; i < rays.size(); ++i) {
    const glm::vec2 at = 2.0f * (glm::vec2(i % size, i / size) + 0.5f) / float(size) - 1.0f;
    rays[i].origin = origin;
    rays[i].direction = glm::normalize(glm::vec3(at, 1.0f));
  }
  return rays;
}

// The reference: every triangle of the scene in world space, each tried by Cramer's rule in double precision.
class BruteForce {
 public:
  explicit BruteForce(const Scene& scene) {
    for (const uint32_t id : scene.instance_slots()) {
      first_.push_back(triangles_.size());
      if (id == none) continue;
      const auto& instance = scene.instances()[id];
      const Mesh& mesh = scene.meshes()[instance.mesh];
      for (uint32_t i = 0; i < mesh.indices.size(); ++i) {
        glm::dvec3 corner[3];
        for (int k = 0; k < 3; ++k) corner[k] = instance.local_to_world * glm::dvec4(mesh.positions[mesh.indices[i][k]], 1.0);
        triangles_.push_back({corner[0], corner[1] - corner[0], corner[2] - corner[0], instance.environment});
      }
    }
  }

  /// Distance to the nearest hit, infinite when there is none. All triangles and the interval are grown by `slack`; negative shrinks them.
  [[nodiscard]] double nearest(const TestRay& ray, double slack) const {
    double t = std::numeric_limits<double>::infinity();
    for (const Triangle& triangle : triangles_) t = std::min(t, distance(triangle, ray, slack));
    return t;
  }

  /// Distance to the triangle that a tracer names, and the point its barycentrics stand for.
  [[nodiscard]] double distance_to(const TestHit& hit, const TestRay& ray, double slack) const {
    return distance(triangles_.at(first_.at(hit.instance) + hit.primitive), ray, slack);
  }
  [[nodiscard]] glm::dvec3 point(const TestHit& hit) const {
    const Triangle& triangle = triangles_.at(first_.at(hit.instance) + hit.primitive);
    return triangle.v0 + double(hit.u) * triangle.e1 + double(hit.v) * triangle.e2;
  }

 private:
  struct Triangle {
    glm::dvec3 v0, e1, e2;
    uint32_t environment;
  };

  static double distance(const Triangle& triangle, const TestRay& ray, double slack) {
    const double none_there = std::numeric_limits<double>::infinity();
    if (triangle.environment != none && triangle.environment != ray.environment) return none_there;
    const glm::dvec3 direction(ray.direction), to_v0 = triangle.v0 - glm::dvec3(ray.origin);
    // o + t d = v0 + u e1 + v e2
    const glm::dvec3 normal = glm::cross(triangle.e1, triangle.e2);
    const double determinant = glm::dot(normal, direction);
    if (determinant == 0.0) return none_there;
    const double t = glm::dot(normal, to_v0) / determinant;
    const double u = glm::dot(glm::cross(triangle.e2, direction), -to_v0) / determinant;
    const double v = glm::dot(glm::cross(direction, triangle.e1), -to_v0) / determinant;
    const bool inside = u >= -slack && v >= -slack && u + v <= 1.0 + slack;
    const bool in_reach = t >= double(ray.t_near) - slack && t <= double(ray.t_far) + slack * std::max(1.0, std::abs(t));
    return inside && in_reach ? t : none_there;
  }

  std::vector<Triangle> triangles_;
  std::vector<size_t> first_;  // per slot of the instances
};

}  // namespace kuafu::test
