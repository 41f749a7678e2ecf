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

/// One queue of rays, laid out as in shaders/shared/ray_queue.h.
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

/// The tables that a tracer needs to follow shadow rays through glass.
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
  /// The fewest groups that indirect arguments ask for, or one per ray if rays are fewer; 0: only as many as the rays fill.
  [[nodiscard]] virtual uint32_t spread_groups() const { return 0; }
  /// Updates the acceleration structure; its cost depends on what changed (Scene::revisions). No work may be under way. open: times that
  /// rays may have (ray_time) if instances move; an instant is time 0.
  virtual void update(const Scene& scene, uint32_t environment_count, const TimeSpan& open) = 0;
  /// Lets a driver compile in parallel what `closest` needs, and `occluded` if it will be called; call after update(). cutouts: whether any
  /// material is a cutout.
  virtual void prepare([[maybe_unused]] bool cutouts, [[maybe_unused]] bool occluded) {}
  /// Finds each ray's nearest hit in [t_near, t_far]. A host tracer flushes `commands` and works on the mapped queue; a device tracer
  /// records.
  virtual void closest(ks::Commands& commands, const RayQueue& rays) = 0;
  /// Finds any hit in [t_near, t_far]: t_far becomes negative if something blocks the ray.
  virtual void occluded(ks::Commands& commands, const RayQueue& rays) = 0;
  /// Whether the tracer has occluded_by_more_than_glass(). Otherwise the path tracer calls closest() for each surface on the way.
  [[nodiscard]] virtual bool passes_glass() const { return false; }
  /// Works as occluded(), but smooth glass only dims the ray's contribution (shaders/stage/glass.glsl).
  virtual void occluded_by_more_than_glass(ks::Commands&, const RayQueue&, const GlassWay&) {}
};

std::unique_ptr<Tracer> make_embree_tracer(std::shared_ptr<ks::Device> device);
std::unique_ptr<Tracer> make_compute_tracer(std::shared_ptr<ks::Device> device, uint32_t layout = queue_layout_planes);
/// Makes a tracer on the driver's ray tracing pipelines. Throws KS_ERROR_UNSUPPORTED if the device has none (KS_CAP_RAY_TRACING_PIPELINE).
std::unique_ptr<Tracer> make_rt_tracer(std::shared_ptr<ks::Device> device);

}  // namespace kuafu
