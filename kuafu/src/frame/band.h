// Which light is rendered, and what lights and surfaces give in it where they do not say (kuafu_render_desc).
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

namespace kuafu {

struct Band {
  bool infrared = false;
  float ir_ambient_scale = 0.05f;
  float ir_ambient_radiance = 0.0f;  // W/(sr m^2)
  bool operator==(const Band&) const = default;

  [[nodiscard]] uint32_t channels() const { return infrared ? 1 : 3; }
  [[nodiscard]] glm::vec3 intensity(const glm::vec3& visible, float infrared_value) const {
    if (!infrared) return visible;
    return glm::vec3(std::isnan(infrared_value) ? visible.r * ir_ambient_scale : infrared_value);
  }
  [[nodiscard]] glm::vec3 environment(const glm::vec3& visible, float infrared_value) const {
    if (!infrared) return visible;
    return glm::vec3(std::isnan(infrared_value) ? visible.r * ir_ambient_scale + ir_ambient_radiance : infrared_value);
  }
};

}  // namespace kuafu
