// SPDX-License-Identifier: Apache-2.0
// The search for bent ways, on the shaders' text compiled as C++: the energy that it finds behind a ball, near and far, in and beside the
// straight shadow, against rays traced from the lamp through the exact ball; and how many segments it takes for that.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "frame/host_language.h"
#include "kuafu/material/fresnel.h"
#include "shared/wave.h"

#define KUAFU_CHANNELS 1
namespace kuafu {
namespace {

constexpr uint features = 0u;
#include "lib/shading.glsl"

struct Push {
  uint surfaces, has_medium;
  SceneReference scene;
};

struct Search {
  const Push& push;
#include "stage/glass.glsl"

#include "stage/bend.glsl"
};

constexpr double pi_exactly = std::numbers::pi;
constexpr float ior = 1.5f;
constexpr int rings = 40;

/// A ball of glass, a lamp of 1 W/sr at the origin.
class Ball {
 public:
  Ball(float centre, float radius) : centre_(centre), radius_(radius) {
    constexpr int columns = 2 * rings;
    for (int r = 0; r <= rings; ++r)
      for (int c = 0; c <= columns; ++c) {
        const double theta = pi_exactly * r / rings, phi = 2 * pi_exactly * c / columns;
        normals_.emplace_back(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
        positions_.push_back(vec3(0, 0, centre) + radius * normals_.back());
      }
    for (uint r = 0; r < rings; ++r)
      for (uint c = 0; c < columns; ++c) {
        const uint here = r * (columns + 1) + c, down = here + columns + 1;
        if (r > 0) triangles_.emplace_back(here, down, here + 1);
        if (r + 1 < rings) triangles_.emplace_back(here + 1, down, down + 1);
      }
    instance_.positions.at = positions_.data();
    instance_.normals.at = normals_.data();
    instance_.indices.at = triangles_.data();
    instance_.flags = instance_has_normals;
    for (int i = 0; i < 3; ++i) {
      instance_.local_to_world[i] = vec4(i == 0, i == 1, i == 2, 0);
      instance_.normal_to_world[i] = vec3(i == 0, i == 1, i == 2);
    }
    glass_.base_color = vec3(1);
    glass_.specular = glass_.transmission = 1.0f;
    glass_.ior = ior;
    box_ = {vec3(-radius, -radius, centre - radius), vec3(radius, radius, centre + radius)};
    scene_.instances.at = &instance_;
    scene_.instance_materials.at = &material_;
    scene_.materials.at = &glass_;
    scene_.glass_boxes.at = &box_;
    scene_.glass_box_count = 1;
    push_.scene.at = &scene_;
  }
  Ball(const Ball&) = delete;
  Ball& operator=(const Ball&) = delete;

  struct Found {
    double irradiance;  // of the plane z = from.z by bent ways
    uint segments;      // that the search followed
  };
  [[nodiscard]] Found search_from(const vec3& from, float random) const {
    Search search{push_};
    Ray ray{from, 0.0f, normalize(-from), 1e30f};
    Search::Bend bend = search.begin_bend(ray, vec3(0), false, box_, random);
    Search::MetSurface met = meet(ray);
    uint state = hits(met) ? search.follow_bend(bend, ray, true, met, 0.0f) : search.look_beside(bend, ray, 1.0f);
    vec3 direction(0);
    for (;;) {
      if (bend.taken) direction = bend.taken_direction;
      if (state == search.bend_ends) return {bend.total * std::abs(direction.z), bend.segments};
      met = meet(ray);
      state = search.follow_bend(bend, ray, hits(met), met, 0.0f);
    }
  }

  /// Power in a disc of the plane around the axis: asked for point by point, and traced from the lamp.
  [[nodiscard]] double found(float wall, double disc, int points) const {
    double sum = 0;
    for (int i = 0; i < points; ++i) {
      const double r = (i + 0.5) / points * disc, phi = 2.399963 * i;
      const Found at = search_from({float(r * std::cos(phi)), float(r * std::sin(phi)), wall}, float(std::fmod(0.618034 * i, 1.0)));
      sum += at.irradiance * 2 * pi_exactly * r;
    }
    return sum * disc / points;
  }
  /// Mean segments of a search between two radii of the plane.
  [[nodiscard]] double segments(float wall, double inner, double outer) const {
    double sum = 0;
    constexpr int points = 100;
    for (int i = 0; i < points; ++i) sum += search_from({float(inner + (outer - inner) * (i + 0.5) / points), 0, wall}, 0.5f).segments;
    return sum / points;
  }
  [[nodiscard]] double traced(float wall, double disc) const {
    constexpr int rays = 200000;
    const double most = std::asin(radius_ / centre_);
    double sum = 0;
    for (int i = 0; i < rays; ++i) {
      // The ray meets the ball, seen from its centre, at the angle in - angle from the lamp; its chord spans pi - 2 inside.
      const double angle = most * (i + 0.5) / rays, in = std::asin(centre_ * std::sin(angle) / radius_),
                   inside = std::asin(std::sin(in) / ior);
      const double exit = 2 * inside - in + angle, direction = angle - 2 * (in - inside), through = 1 - laws::reflectance(in, ior);
      const double x = radius_ * std::sin(exit) + std::tan(direction) * (wall - centre_ - radius_ * std::cos(exit));
      if (std::abs(x) < disc) sum += through * through * 2 * pi_exactly * std::sin(angle) * most / rays;
    }
    return sum;
  }
  [[nodiscard]] double shadow(float wall) const { return wall * std::tan(std::asin(radius_ / centre_)); }

 private:
  static bool hits(const Search::MetSurface& met) { return met.primitive != miss; }

  /// The nearest triangle (Möller and Trumbore 1997).
  [[nodiscard]] Search::MetSurface meet(const Ray& ray) const {
    Search::MetSurface met{0, miss, 0, 0, 1e30f};
    const vec3 from = ray.origin - vec3(0, 0, centre_);
    const float along = dot(from, ray.direction);
    if (along * along < dot(from, from) - radius_ * radius_) return met;
    for (uint i = 0; i < triangles_.size(); ++i) {
      const vec3 p = positions_[triangles_[i].x], e1 = positions_[triangles_[i].y] - p, e2 = positions_[triangles_[i].z] - p;
      const vec3 across = cross(ray.direction, e2), way = ray.origin - p, turned = cross(way, e1);
      const float inverse = 1.0f / dot(e1, across), u = dot(way, across) * inverse, v = dot(ray.direction, turned) * inverse;
      const float t = dot(e2, turned) * inverse;
      if (u >= 0 && v >= 0 && u + v <= 1 && t > 0 && t < met.t) met = {0, i, u, v, t};
    }
    return met;
  }

  float centre_, radius_;
  std::vector<vec3> positions_, normals_;
  std::vector<uvec3> triangles_;
  InstanceRecord instance_{};
  MaterialRecord glass_{};
  uint material_ = 0;
  GlassBox box_{};
  SceneAddresses scene_{};
  Push push_{.surfaces = 8, .has_medium = 0, .scene = {}};
};

TEST(Bend, beyond_the_focus_all_light_in_the_shadow_is_found) {
  const Ball ball(0.7f, 0.06f);
  EXPECT_NEAR(ball.found(1.4f, ball.shadow(1.4f), 150) / ball.traced(1.4f, ball.shadow(1.4f)), 1, 0.01);
}

TEST(Bend, light_that_lands_beside_the_shadow_is_found) {
  const Ball ball(0.7f, 0.06f);
  const double disc = 4 * ball.shadow(1.4f), traced = ball.traced(1.4f, disc);
  EXPECT_GT(traced, 4 * ball.traced(1.4f, ball.shadow(1.4f)));
  EXPECT_NEAR(ball.found(1.4f, disc, 300) / traced, 1, 0.01);
}

TEST(Bend, a_search_follows_few_segments) {
  const Ball ball(0.7f, 0.06f);
  const double shadow = ball.shadow(1.4f);
  EXPECT_LT(ball.segments(1.4f, 0, 0.95 * shadow), 9);
  EXPECT_LT(ball.segments(1.4f, 1.05 * shadow, 2 * shadow), 9);
}

TEST(Bend, where_several_ways_cross_their_energy_is_kept) {
  const Ball ball(0.7f, 0.06f);
  EXPECT_NEAR(ball.found(0.8f, ball.shadow(0.8f), 1600) / ball.traced(0.8f, ball.shadow(0.8f)), 1, 0.05);
}

}  // namespace
}  // namespace kuafu
