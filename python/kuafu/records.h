// SPDX-License-Identifier: Apache-2.0
// Material, Light, Camera, Optics and Medium as Python sees them: the C descriptor and the memory it points to.
#pragma once

#include <vector>

#include "kuafu_api.h"

namespace ks_python {

struct Material {
  kuafu_material_desc c = kuafu_material_desc_init();
  std::string name;
  [[nodiscard]] kuafu_material_desc desc() const {
    kuafu_material_desc d = c;
    d.name = name.c_str();
    return d;
  }
};

struct Light {
  kuafu_light_desc c = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
  std::string name;
  std::vector<float> dots;  // [dot_count][3]
  [[nodiscard]] kuafu_light_desc desc() const {
    kuafu_light_desc d = c;
    d.name = name.c_str();
    d.dots = dots.empty() ? nullptr : dots.data();
    d.dot_count = static_cast<uint32_t>(dots.size() / 3);
    return d;
  }
};

struct Camera {
  kuafu_camera_desc c = kuafu_camera_desc_init();
};

struct Optics {
  kuafu_optics_desc c = kuafu_optics_desc_init();
};

struct Medium {
  kuafu_medium_desc c = kuafu_medium_desc_init();
};

inline std::string text_of(const char* name) { return name ? name : ""; }

inline uint32_t environment_of(const std::optional<uint32_t>& environment) { return environment.value_or(KUAFU_ALL_ENVIRONMENTS); }

}  // namespace ks_python
