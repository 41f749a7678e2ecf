// SPDX-License-Identifier: Apache-2.0
// The reference: every triangle of the scene in world space, each tried by Cramer's rule in double precision.
#pragma once

#include <cmath>
#include <vector>

#include "kuafu/accel/ray_bench.h"

namespace kuafu::test {

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
