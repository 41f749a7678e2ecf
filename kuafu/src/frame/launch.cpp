// SPDX-License-Identifier: Apache-2.0
// This file turns the views of a launch into the records that stages read: the rays of a pinhole, and what a lens, a shutter and motion
// add.
#include "frame/launch.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace kuafu {
namespace {

// The mixing step of splitmix64, which is the finaliser of MurmurHash3 (Appleby).
uint64_t mix(uint64_t h, uint64_t value) {
  h ^= value + 0x9e3779b97f4a7c15u + (h << 6) + (h >> 2);
  h = (h ^ (h >> 33)) * 0xff51afd7ed558ccdu;
  h = (h ^ (h >> 33)) * 0xc4ceb9fe1a85ec53u;
  return h ^ (h >> 33);
}

uint32_t view_key(const Launch& launch, const View& view) {
  uint64_t h = mix(launch.seed, view.environment);
  for (int i = 0; i < 9; ++i) h = mix(h, std::bit_cast<uint64_t>(view.k[i / 3][i % 3] + 0.0));  // + 0.0 makes -0 a 0
  for (int i = 0; i < 16; ++i) h = mix(h, std::bit_cast<uint64_t>(view.camera_to_world[i / 4][i % 4] + 0.0));
  return uint32_t(h ^ (h >> 32));
}

glm::vec2 seconds_per_pixel(const Shutter& shutter) {
  if (shutter.kind == Shutter::Kind::global) return glm::vec2(0.0f);
  const auto line_s = float(shutter.line_time_s);
  switch (shutter.readout) {
    case Shutter::Readout::rows_up:
      return {0.0f, -line_s};
    case Shutter::Readout::columns_right:
      return {line_s, 0.0f};
    case Shutter::Readout::columns_left:
      return {-line_s, 0.0f};
    default:
      return {0.0f, line_s};
  }
}

CameraPose camera_pose(const glm::dmat4& camera_to_world) {
  return {.origin = glm::vec3(camera_to_world[3]),
          .axis_x = glm::vec3(camera_to_world[0]),
          .axis_y = glm::vec3(camera_to_world[1]),
          .axis_z = glm::vec3(camera_to_world[2])};
}

}  // namespace

ViewRecord view_record(const Launch& launch, const View& view) {
  const glm::dmat3 pixel_to_world = glm::dmat3(view.camera_to_world) * glm::inverse(view.k);
  ViewRecord r{};
  r.origin = glm::vec3(view.camera_to_world[3]);
  r.axis_u = glm::vec3(pixel_to_world[0]);
  r.axis_v = glm::vec3(pixel_to_world[1]);
  r.axis_0 = glm::vec3(pixel_to_world[2]);
  r.near_m = float(view.near_m);
  r.far_m = float(view.far_m);
  r.key = view_key(launch, view);
  r.environment = view.environment;
  return r;
}

bool View::special() const { return distorts(lens.distortion) || lens.lens_radius_m > 0.0 || (velocity.moves() && shutter.takes_time()); }

TimeSpan open_span(const Launch& launch) {
  TimeSpan all;
  for (const View& view : launch.views) {
    const TimeSpan span = view.shutter.span(launch.width, launch.height);
    all = {std::min(all.from_s, span.from_s), std::max(all.until_s, span.until_s)};
  }
  return all;
}

CameraRecord camera_record(const View& view) {
  CameraRecord r{};
  r.axis_x = glm::vec3(view.camera_to_world[0]);
  r.axis_y = glm::vec3(view.camera_to_world[1]);
  r.axis_z = glm::vec3(view.camera_to_world[2]);
  r.motion = motion_record(view.camera_to_world, view.velocity);
  r.focal = {float(view.k[0][0]), float(view.k[1][1])};
  r.centre = glm::vec2(view.k[2]);
  r.skew = float(view.k[1][0]);
  r.lens = lens_record(view.lens.distortion);
  r.lens_radius_m = float(view.lens.lens_radius_m);
  r.inverse_focus = view.lens.lens_radius_m > 0.0 ? float(1.0 / view.lens.focus_m) : 0.0f;
  r.seconds_per_pixel = seconds_per_pixel(view.shutter);
  r.exposure_s = float(view.shutter.exposure_s);
  r.flags = (distorts(view.lens.distortion) ? camera_distorts : 0) | (view.lens.lens_radius_m > 0.0 ? camera_has_lens : 0) |
            (view.velocity.moves() ? camera_moves : 0);
  return r;
}

MotionView motion_view(const View& view) {
  MotionView m{};
  m.now = camera_pose(view.camera_to_world);
  m.previous = camera_pose(view.previous_camera_to_world);
  m.focal = {float(view.k[0][0]), float(view.k[1][1])};
  m.centre = glm::vec2(view.k[2]);
  m.skew = float(view.k[1][0]);
  m.lens = lens_record(view.lens.distortion);
  return m;
}

}  // namespace kuafu
