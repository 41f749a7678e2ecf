// SPDX-License-Identifier: Apache-2.0
// Scene, and Material, Light, Camera, Optics and Medium as Python sees them: the C descriptor and the memory it points to. Thread rule: one
// thread at a time may use a scene; a second call is refused.
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

class Scene {
 public:
  explicit Scene(std::shared_ptr<Device<Kuafu>> device) : device(std::move(device)) {
    check<Kuafu>(kuafu_scene_create(this->device->get(), handle.put()));
  }
  [[nodiscard]] kuafu_scene get() const { return handle.get(); }

  std::shared_ptr<Device<Kuafu>> device;
  Handle<kuafu_scene, kuafu_scene_release> handle;
};

}  // namespace ks_python
