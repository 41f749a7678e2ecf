// SPDX-License-Identifier: Apache-2.0
// A tracer answers ray queues. The path tracer is written once and knows only this interface (design: wavefront stages, pluggable rays).
// Implementations: EmbreeTracer (host, in place on mapped queues; CPU devices), ComputeTracer (own two-level BVH2 in Vulkan compute),
// RtTracer (the driver's, VK_KHR_ray_tracing_pipeline).
// Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "device/compute.h"
#include "scene/scene.h"
#include "shared/ray_queue.h"

namespace kuafu {

/// One queue of rays, laid out as shaders/shared/ray_queue.h says.
struct RayQueue {
  const ks::Buffer* words = nullptr;         // capacity * (closest_words or occlusion_words) uint32; host visible on CPU devices
  const ks::Buffer* environments = nullptr;  // uint32 per ray: environment of ray i; nullptr = all 0
  const ks::Buffer* counters = nullptr;
  uint64_t count_offset = 0;      // uint32 ray count
  uint64_t arguments_offset = 0;  // VkDispatchIndirectCommand for trace_group_size
  uint32_t capacity = 0;          // multiple of 8
  uint64_t scene = 0;             // SceneReference, where some surfaces are not everywhere there (lib/cutout.glsl); else 0
  bool coherent = false;          // a hint: neighbours in the queue go nearly the same way, as camera rays do
};

/// What a tracer must know to follow shadow rays through glass.
struct GlassWay {
  uint64_t contributions = 0, scene = 0;  // device addresses (FloatArray, SceneReference)
  uint32_t surfaces = 0;                  // that a ray may pass
  uint32_t features = 0;                  // feature_* of the scene
  bool infrared = false, medium = false;
};

class Tracer {
 public:
  virtual ~Tracer() = default;
  [[nodiscard]] virtual const char* name() const = 0;
  [[nodiscard]] virtual uint32_t queue_layout() const = 0;      // queue_layout_planes or queue_layout_packets
  [[nodiscard]] virtual uint32_t trace_group_size() const = 0;  // workgroup size the indirect arguments are made for
  /// Indirect arguments ask for at least so many groups, or for one per ray where those are fewer; 0: never for more than rays fill.
  [[nodiscard]] virtual uint32_t spread_groups() const { return 0; }
  /// Brings the acceleration structure up to date with the scene; cost follows what changed (Scene::revisions). No work may be in flight.
  /// open: times that rays may have (ray_time), where instances move; an instant is time 0.
  virtual void update(const Scene& scene, uint32_t environment_count, const TimeSpan& open) = 0;
  /// After update, has a driver compile side by side what `closest` needs, and `occluded` where it will be called. cutouts: some surfaces
  /// are not everywhere there.
  virtual void prepare([[maybe_unused]] bool cutouts, [[maybe_unused]] bool occluded) {}
  /// Nearest hit in [t_near, t_far] of each ray. A host tracer flushes `commands` first and works on the mapped queue; a device tracer
  /// records.
  virtual void closest(ks::Commands& commands, const RayQueue& rays) = 0;
  /// Any hit in [t_near, t_far]: t_far becomes negative where something stands in the way.
  virtual void occluded(ks::Commands& commands, const RayQueue& rays) = 0;
  /// Whether it has occluded_by_more_than_glass; else the path tracer asks `closest` for each surface on the way.
  [[nodiscard]] virtual bool passes_glass() const { return false; }
  /// As occluded, but smooth glass in the way only dims the ray's contribution (shaders/stage/glass.glsl).
  virtual void occluded_by_more_than_glass(ks::Commands&, const RayQueue&, const GlassWay&) {}
};

std::unique_ptr<Tracer> make_embree_tracer(std::shared_ptr<ks::Device> device);
std::unique_ptr<Tracer> make_compute_tracer(std::shared_ptr<ks::Device> device, uint32_t layout = queue_layout_planes);
/// Throws KS_ERROR_UNSUPPORTED where the device has no ray tracing pipelines (KS_CAP_RAY_TRACING_PIPELINE).
std::unique_ptr<Tracer> make_rt_tracer(std::shared_ptr<ks::Device> device);

}  // namespace kuafu
