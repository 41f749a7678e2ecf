// SPDX-License-Identifier: Apache-2.0
// A band is the kind of light that a launch renders: visible or infrared (kuafu_render_desc). A description may leave its infrared value
// open (NaN); this is the only file that knows what is meant then. Records for shaders hold the values of one band alone.
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
  /// A material's or medium's number in this band. Without an infrared value the visible one applies; of a colour, its red channel.
  [[nodiscard]] float number(float visible, float infrared_value) const {
    return !infrared || std::isnan(infrared_value) ? visible : infrared_value;
  }
  [[nodiscard]] glm::vec3 color(const glm::vec3& visible, float infrared_value) const {
    return infrared ? glm::vec3(number(visible.r, infrared_value)) : visible;
  }
  /// A light's intensity in this band. Without an infrared value it is the red channel times ir_ambient_scale and the light's ir_share,
  /// where 0 means 1.
  [[nodiscard]] glm::vec3 intensity(const glm::vec3& visible, float infrared_value, double ir_share) const {
    if (!infrared) return visible;
    const float share = ir_share == 0.0 ? 1.0f : static_cast<float>(ir_share);
    return glm::vec3(std::isnan(infrared_value) ? visible.r * ir_ambient_scale * share : infrared_value);
  }
  /// The environment's radiance in this band. Without an infrared value it is the red channel times ir_ambient_scale, plus
  /// ir_ambient_radiance.
  [[nodiscard]] glm::vec3 environment(const glm::vec3& visible, float infrared_value) const {
    if (!infrared) return visible;
    return glm::vec3(std::isnan(infrared_value) ? visible.r * ir_ambient_scale + ir_ambient_radiance : infrared_value);
  }
};

}  // namespace kuafu
