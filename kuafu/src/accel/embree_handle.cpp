// SPDX-License-Identifier: Apache-2.0
#include "accel/embree_handle.h"

#include <atomic>
#include <cstdlib>
#include <utility>

#include "device/error.h"

namespace kuafu {
namespace {

std::atomic<bool> has_ended = false;

/// The library is open before the handler is registered, so that the handler runs before the library's own.
RTCDevice new_device() {
  const EmbreeLibrary& library = embree_library();
  static const int registered = std::atexit([] { has_ended = true; });
  check_embree_lives();
  return registered == 0 ? library.rtcNewDevice(nullptr) : nullptr;
}

}  // namespace

bool embree_has_ended() { return has_ended; }

void check_embree_lives() {
  if (has_ended) ks::fail(KS_ERROR_INVALID_STATE, "the program is ending, and has ended Embree: render before main returns");
}

EmbreeDevice::EmbreeDevice() : device_(new_device()) {
  if (!device_)
    ks::fail(KS_ERROR_UNSUPPORTED, "Embree gives no device (error %d): it needs a CPU with SSE2", int(rtcGetDeviceError(nullptr)));
  rtcSetDeviceErrorFunction(device_, record, this);
}

EmbreeDevice::~EmbreeDevice() {
  if (!has_ended) rtcReleaseDevice(device_);
}

EmbreeScene EmbreeDevice::new_scene() const {
  EmbreeScene scene(rtcNewScene(device_));
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  return scene;
}

void EmbreeDevice::record(void* self, RTCError code, const char* text) {
  auto* device = static_cast<EmbreeDevice*>(self);
  const std::lock_guard lock(device->mutex_);
  if (device->error_ != RTC_ERROR_NONE) return;
  device->error_ = code;
  device->text_ = text ? text : "";
}

void EmbreeDevice::forget_errors() {
  const std::lock_guard lock(mutex_);
  error_ = RTC_ERROR_NONE;
}

void EmbreeDevice::check(const char* what) {
  const std::lock_guard lock(mutex_);
  const RTCError code = std::exchange(error_, RTC_ERROR_NONE);
  if (code == RTC_ERROR_NONE) return;
  if (code == RTC_ERROR_CANCELLED) ks::fail(KS_ERROR_CANCELLED, "cancelled while %s", what);
  const ks_status status = code == RTC_ERROR_OUT_OF_MEMORY     ? KS_ERROR_OUT_OF_HOST_MEMORY
                           : code == RTC_ERROR_UNSUPPORTED_CPU ? KS_ERROR_UNSUPPORTED
                                                               : KS_ERROR_INTERNAL;
  ks::fail(status, "Embree, %s: %s (error %d)", what, text_.c_str(), int(code));
}

}  // namespace kuafu
