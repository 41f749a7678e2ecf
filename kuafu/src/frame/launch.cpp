#include "frame/launch.h"

#include <bit>

namespace kuafu {
namespace {

// Finaliser of MurmurHash3 (Appleby), the mixing step of splitmix64.
uint64_t mix(uint64_t h, uint64_t value) {
  h ^= value + 0x9e3779b97f4a7c15u + (h << 6) + (h >> 2);
  h = (h ^ (h >> 33)) * 0xff51afd7ed558ccdu;
  h = (h ^ (h >> 33)) * 0xc4ceb9fe1a85ec53u;
  return h ^ (h >> 33);
}

uint32_t view_key(const Launch& launch, const View& view) {
  uint64_t h = mix(launch.seed, view.environment);
  for (int i = 0; i < 9; ++i) h = mix(h, std::bit_cast<uint64_t>(view.k[i / 3][i % 3] + 0.0));  // + 0.0: -0 is 0
  for (int i = 0; i < 16; ++i) h = mix(h, std::bit_cast<uint64_t>(view.camera_to_world[i / 4][i % 4] + 0.0));
  return uint32_t(h ^ (h >> 32));
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

}  // namespace kuafu
