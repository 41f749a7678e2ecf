// Which light is rendered, and what materials, lights and media are in it. This is the only place that knows what a description that says
// nothing of the infrared band (NaN) means there; records for shaders hold the band's values alone (kuafu_render_desc).
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
  /// Of materials and media: as in the visible band, of colours as red, where nothing is said.
  [[nodiscard]] float number(float visible, float infrared_value) const {
    return !infrared || std::isnan(infrared_value) ? visible : infrared_value;
  }
  [[nodiscard]] glm::vec3 color(const glm::vec3& visible, float infrared_value) const {
    return infrared ? glm::vec3(number(visible.r, infrared_value)) : visible;
  }
  /// Of lights: red, scaled, where nothing is said.
  [[nodiscard]] glm::vec3 intensity(const glm::vec3& visible, float infrared_value) const {
    if (!infrared) return visible;
    return glm::vec3(std::isnan(infrared_value) ? visible.r * ir_ambient_scale : infrared_value);
  }
  /// Of the environment: the same, and the sun's and lamps' infrared light besides.
  [[nodiscard]] glm::vec3 environment(const glm::vec3& visible, float infrared_value) const {
    if (!infrared) return visible;
    return glm::vec3(std::isnan(infrared_value) ? visible.r * ir_ambient_scale + ir_ambient_radiance : infrared_value);
  }
};

}  // namespace kuafu
