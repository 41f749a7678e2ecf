// SPDX-License-Identifier: Apache-2.0
#include "tables/beam_sources.h"

#include <algorithm>
#include <cmath>

#include "material/material_record.h"
#include "scene/box_corners.h"

namespace kuafu {
namespace {

constexpr double least_facing = 0.2;  // of a box's corners, else the light is too near for one plane
constexpr uint32_t turned_part = 4;   // of all beams, those of light that is reflected in part
constexpr uint32_t least_side = 8;    // nodes along a grid

struct Frame {
  glm::dvec3 u, v, axis;
};

Frame frame_around(const glm::dvec3& axis) {
  const glm::dvec3 beside = std::abs(axis.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(beside, axis));
  return {u, glm::cross(axis, u), axis};
}

struct Window {
  glm::dvec2 low{1e300}, high{-1e300};
  void take(const glm::dvec2& p) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
};

/// Adds grids, of about so many beams, to what there is.
class Grids {
 public:
  /// grids: how many the light's environment has.
  Grids(BeamSources& out, uint32_t& grids, const SharpLight& light, const GlassBody& body)
      : out_(out), grids_(grids), light_(light), body_(body) {}

  void add(const glm::dvec3& origin, const Frame& frame, const Window& window, double beams) {
    add_grid(origin, frame, window, beams * (turned_part - 1) / turned_part, 0);
    add_grid(origin, frame, window, beams / turned_part, source_turned);
  }

 private:
  /// The nodes go one step beyond the window on one side: moved by up to a step they cover it.
  void add_grid(const glm::dvec3& origin, const Frame& frame, const Window& window, double beams, uint32_t flags) {
    const uint32_t side = std::max(least_side, uint32_t(std::sqrt(beams)));
    const glm::dvec2 step = glm::max(window.high - window.low, glm::dvec2(1e-9)) / double(side);
    const double reach_m = light_.directional ? 1.0 : glm::length(0.5 * (body_.min + body_.max) - origin);
    const double finest_m = std::max(1e-7, std::min(step.x, step.y) * reach_m);  // between neighbours where they reach their glass
    out_.sources.push_back({.origin = glm::vec3(origin),
                            .axis_u = glm::vec3(frame.u),
                            .axis_v = glm::vec3(frame.v),
                            .axis = glm::vec3(frame.axis),
                            .first = glm::vec2(window.low - step),
                            .step = glm::vec2(step),
                            .columns = side + 2,
                            .first_beam = out_.beam_count,
                            .light = light_.index,
                            .environment = light_.environment,
                            .instance = body_.slot,
                            .flags = flags | (light_.directional ? source_directional : 0),
                            .key = grids_++,
                            .least_level = std::clamp(int(std::floor(std::log2(finest_m))), splat_least_level, splat_most_level)});
    out_.beam_count += (side + 2) * (side + 2);
  }

  BeamSources& out_;
  uint32_t& grids_;
  const SharpLight& light_;
  const GlassBody& body_;
};

void add_directional(Grids& grids, const SharpLight& light, const GlassBody& body, double world_radius_m, double beams) {
  const Frame frame = frame_around(light.direction);
  const glm::dvec3 middle = 0.5 * (body.min + body.max);
  Window window;
  for (const glm::dvec3& corner : box_corners(body)) window.take({glm::dot(corner - middle, frame.u), glm::dot(corner - middle, frame.v)});
  grids.add(middle - frame.axis * (2 * world_radius_m + glm::length(body.max - body.min)), frame, window, beams);
}

void add_from_point(Grids& grids, const SharpLight& light, const GlassBody& body, double beams) {
  const glm::dvec3 from(light.position), middle = 0.5 * (body.min + body.max);
  const bool inside = glm::all(glm::greaterThanEqual(from, body.min)) && glm::all(glm::lessThanEqual(from, body.max));
  if (!inside) {
    const Frame frame = frame_around(glm::normalize(middle - from));
    Window window;
    bool faces = true;
    for (const glm::dvec3& corner : box_corners(body)) {
      const glm::dvec3 way = corner - from;
      const double along = glm::dot(way, frame.axis);
      faces = faces && along > least_facing * glm::length(way);
      if (faces) window.take({glm::dot(way, frame.u) / along, glm::dot(way, frame.v) / along});
    }
    if (faces) return grids.add(from, frame, window, beams);
  }
  Window whole;
  whole.take(glm::dvec2(-1));
  whole.take(glm::dvec2(1));
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {-1.0, 1.0}) {
      glm::dvec3 towards(0);
      towards[axis] = sign;
      grids.add(from, frame_around(towards), whole, beams / 6);
    }
}

bool bends(const Scene& scene, const Instance& instance, const Band& band) {
  return std::ranges::any_of(instance.materials,
                             [&](uint32_t id) { return id != none && bends_light(in_band(scene.materials()[id], band)); });
}

}  // namespace

void GlassBodies::update(const Scene& scene, const Band& band) {
  bodies_.clear();
  for (uint32_t slot = 0; slot < scene.instance_slots().size(); ++slot) {
    const uint32_t id = scene.instance_slots()[slot];
    if (id == none) continue;
    const Instance& instance = scene.instances()[id];
    const Mesh& mesh = scene.meshes()[instance.mesh];
    if (!bends(scene, instance, band) || mesh.positions.empty()) continue;
    GlassBody body{.min = glm::dvec3(1e300), .max = glm::dvec3(-1e300), .slot = slot, .environment = instance.environment};
    for (const glm::dvec3& corner : box_corners(mesh.bounds)) {
      const glm::dvec3 world(instance.local_to_world * glm::dvec4(corner, 1.0));
      body.min = glm::min(body.min, world);
      body.max = glm::max(body.max, world);
    }
    bodies_.push_back(body);
  }
}

BeamSources make_beam_sources(const std::vector<SharpLight>& lights, const std::vector<GlassBody>& bodies, double world_radius_m,
                              uint32_t environment_count, uint32_t beams_per_environment) {
  BeamSources out;
  const auto meet = [](const SharpLight& light, const GlassBody& body) {
    return body.environment == none || body.environment == light.environment;
  };
  std::vector<uint32_t> pairs(environment_count), grids_of(environment_count);
  for (const SharpLight& light : lights)
    for (const GlassBody& body : bodies)
      if (meet(light, body)) ++pairs[light.environment];
  for (const SharpLight& light : lights)
    for (const GlassBody& body : bodies) {
      if (!meet(light, body)) continue;
      Grids grids(out, grids_of[light.environment], light, body);
      const double beams = double(beams_per_environment) / pairs[light.environment];
      if (light.directional)
        add_directional(grids, light, body, world_radius_m, beams);
      else
        add_from_point(grids, light, body, beams);
    }
  return out;
}

}  // namespace kuafu
