// SPDX-License-Identifier: Apache-2.0
// The objects behind kuafu's opaque C handles (device/handle.h).
#pragma once

#include "device/buffer.h"
#include "device/device.h"
#include "device/handle.h"
#include "scene/scene.h"

namespace kuafu {

/// A scene of the C API with its device, whose log takes the warnings of loaded files.
struct DeviceScene {
  explicit DeviceScene(std::shared_ptr<ks::Device> d) : device(std::move(d)) {}
  std::shared_ptr<ks::Device> device;
  Scene scene;
  std::vector<uint32_t> told_materials;        // what kuafu_scene_get_instance points to
  std::atomic<uint32_t> submitted_renders{0};  // that still read the scene
  std::atomic<uint64_t> load_wishes{0};        // how often kuafu_scene_cancel_load was called
};

/// Prevents changes of the scene as long as the result lives.
std::shared_ptr<const void> hold_unchanged(std::shared_ptr<DeviceScene> scene);

}  // namespace kuafu

struct kuafu_device_t : ks::Handle<ks::Device, 0x6b646576> {
  using Handle::Handle;
};

struct kuafu_buffer_t : ks::Handle<ks::Buffer, 0x6b627566> {
  using Handle::Handle;
};

struct kuafu_scene_t : ks::Handle<kuafu::DeviceScene, 0x6b73636e, true> {
  using Handle::Handle;
};
