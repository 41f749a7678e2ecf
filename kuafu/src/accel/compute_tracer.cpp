// SPDX-License-Identifier: Apache-2.0
// Our own two-level BVH2, built on the host and traced in Vulkan compute: the portable tracer of GPUs, and of CPU devices when asked for.
#include <array>
#include <utility>

#include "accel/bvh_world.h"
#include "accel/tracer.h"
#include "device/error.h"
#include "device/pipelines.h"
#include "shared/wave.h"
#include "spirv/trace_closest.h"
#include "spirv/trace_glass_infrared.h"
#include "spirv/trace_glass_visible.h"
#include "spirv/trace_occluded.h"

namespace kuafu {
namespace {

struct TracePush {
  uint64_t words = 0, environments = 0, count = 0, roots = 0, nodes = 0, instances = 0, motions = 0, scene = 0;
  uint32_t capacity = 0, environment_count = 0, has_environments = 0, glass_surfaces = 0;
};

struct GlassPush {
  TracePush trace;
  uint64_t contributions = 0;
  uint32_t has_medium = 0, unused = 0;
};

/// By constant_id (lib/bvh.glsl, lib/bvh_queue.glsl, entry/trace_glass.comp).
using Constants = std::array<uint32_t, 7>;

constexpr uint32_t gpu_spread_groups = 2048;  // about what a large GPU holds at once
// Subgroups of a GPU have 32 or 64 rays, the vectors of a CPU 8 (tests/bench/README.md has what was measured).
constexpr uint32_t gpu_nodes_per_step = 4, cpu_nodes_per_step = 16;

class ComputeTracer final : public Tracer {
 public:
  ComputeTracer(std::shared_ptr<ks::Device> device, uint32_t layout)
      : layout_(layout),
        group_size_(device->is_cpu() ? 8 : 64),
        spread_(device->is_cpu() ? 0 : gpu_spread_groups),
        nodes_per_step_(device->is_cpu() ? cpu_nodes_per_step : gpu_nodes_per_step),
        device_(device),
        world_(std::move(device)) {}

  [[nodiscard]] const char* name() const override { return "compute"; }
  [[nodiscard]] uint32_t queue_layout() const override { return layout_; }
  [[nodiscard]] uint32_t trace_group_size() const override { return group_size_; }
  [[nodiscard]] uint32_t spread_groups() const override { return spread_; }

  void update(const Scene& scene, uint32_t environment_count, const TimeSpan& open) override {
    world_.update(scene, environment_count, open);
  }

  void prepare(bool cutouts, bool occluded) override {
    device_->pipelines().begin(trace_closest_spirv, sizeof(TracePush), of_queue(cutouts));
    if (occluded) device_->pipelines().begin(trace_occluded_spirv, sizeof(TracePush), of_queue(cutouts));
  }

  void closest(ks::Commands& commands, const RayQueue& rays) override { trace(commands, rays, trace_closest_spirv); }

  void occluded(ks::Commands& commands, const RayQueue& rays) override { trace(commands, rays, trace_occluded_spirv); }

  [[nodiscard]] bool passes_glass() const override { return true; }
  void occluded_by_more_than_glass(ks::Commands& commands, const RayQueue& rays, const GlassWay& glass) override {
    GlassPush all{.trace = push(rays), .contributions = glass.contributions, .has_medium = glass.medium ? 1u : 0u};
    all.trace.scene = glass.scene;
    all.trace.glass_surfaces = glass.surfaces;
    commands.dispatch_indirect(glass_pipeline(glass), all, *rays.counters, rays.arguments_offset);
  }

 private:
  void trace(ks::Commands& commands, const RayQueue& rays, std::span<const uint32_t> spirv) {
    const ks::ComputePipeline& pipeline = device_->pipelines().get(spirv, sizeof(TracePush), of_queue(rays.scene != 0));
    commands.dispatch_indirect(pipeline, push(rays), *rays.counters, rays.arguments_offset);
  }

  [[nodiscard]] Constants of_queue(bool cutouts) const {
    return specialisation(world_.moves(), cutouts ? feature_cutouts | feature_lookups : 0);
  }

  [[nodiscard]] Constants specialisation(bool moves, uint32_t features = 0) const {
    return {group_size_, layout_, moves ? 1u : 0u, features, spread_, 0, nodes_per_step_};
  }
  /// Built for the features of a scene that asks for it.
  [[nodiscard]] const ks::ComputePipeline& glass_pipeline(const GlassWay& glass) {
    const uint32_t features = world_.moves() ? glass.features : glass.features & ~feature_motion;  // of lights alone: rays need no time
    return device_->pipelines().get(glass.infrared ? std::span<const uint32_t>(trace_glass_infrared_spirv) : trace_glass_visible_spirv,
                                    sizeof(GlassPush), specialisation(world_.moves(), features));
  }

  [[nodiscard]] TracePush push(const RayQueue& rays) const {
    if (world_.environment_count() == 0) ks::fail(KS_ERROR_INVALID_STATE, "the tracer has not seen a scene yet: call update first");
    return {.words = rays.words->address(),
            .environments = rays.environments ? rays.environments->address() : 0,
            .count = rays.counters->address() + rays.count_offset,
            .roots = world_.roots(),
            .nodes = world_.nodes(),
            .instances = world_.instances(),
            .motions = world_.moves() ? world_.motions() : 0,
            .scene = rays.scene,
            .capacity = rays.capacity,
            .environment_count = world_.environment_count(),
            .has_environments = rays.environments ? 1u : 0u};
  }

  uint32_t layout_, group_size_, spread_, nodes_per_step_;
  std::shared_ptr<ks::Device> device_;
  BvhWorld world_;
};

}  // namespace

std::unique_ptr<Tracer> make_compute_tracer(std::shared_ptr<ks::Device> device, uint32_t layout) {
  return std::make_unique<ComputeTracer>(std::move(device), layout);
}

}  // namespace kuafu
