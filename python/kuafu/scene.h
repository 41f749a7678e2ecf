// SPDX-License-Identifier: Apache-2.0
// Thread rule: one thread at a time; a second call is refused.
#pragma once

#include "records.h"

namespace ks_python {

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
