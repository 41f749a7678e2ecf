// SPDX-License-Identifier: Apache-2.0
// Owning handles of Embree objects, the device that one tracer owns, and the floating-point mode Embree asks for.
// Thread rule: EmbreeDevice is internally synchronised, as Embree is.
#pragma once

#include <xmmintrin.h>

#include <memory>
#include <mutex>
#include <string>

#include "accel/embree_library.h"

namespace kuafu {

/// Whether the program's end has destroyed Embree and TBB before the host's statics that use them. They must then not be called; the
/// process frees what they hold.
bool embree_has_ended();
/// Throws KS_ERROR_INVALID_STATE if embree_has_ended().
void check_embree_lives();

template <class T, const auto& release>
struct EmbreeRelease {
  void operator()(T* object) const {
    if (!embree_has_ended()) release(object);
  }
};
using EmbreeScene = std::unique_ptr<RTCSceneTy, EmbreeRelease<RTCSceneTy, rtcReleaseScene>>;
using EmbreeGeometry = std::unique_ptr<RTCGeometryTy, EmbreeRelease<RTCGeometryTy, rtcReleaseGeometry>>;

/// An RTCDevice that remembers errors for check() to throw. It uses TBB's default pool for building: Embree's "threads=1" limits TBB in the
/// whole process and would make its other users (OpenCV) single-threaded.
class EmbreeDevice {
 public:
  EmbreeDevice();
  ~EmbreeDevice();
  EmbreeDevice(const EmbreeDevice&) = delete;
  EmbreeDevice& operator=(const EmbreeDevice&) = delete;

  [[nodiscard]] RTCDevice handle() const { return device_; }
  /// Makes a scene in robust mode: rays do not slip between triangles, and edges agree with our own BVH.
  [[nodiscard]] EmbreeScene new_scene() const;
  /// Throws the first error since the last check; `what` names the work done.
  void check(const char* what);
  void forget_errors();

 private:
  static void record(void* self, RTCError code, const char* text);
  RTCDevice device_ = nullptr;
  std::mutex mutex_;
  RTCError error_ = RTC_ERROR_NONE;
  std::string text_;
};

/// Flushes denormals to zero in this thread while it lives; Embree's manual asks for it on every tracing thread.
class FlushDenormals {
 public:
  FlushDenormals() : saved_(_mm_getcsr()) { _mm_setcsr(saved_ | flush_to_zero | denormals_are_zero); }
  ~FlushDenormals() { _mm_setcsr(saved_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  static constexpr unsigned flush_to_zero = 0x8000, denormals_are_zero = 0x0040;  // bits of MXCSR
  unsigned saved_;
};

}  // namespace kuafu
