// SPDX-License-Identifier: Apache-2.0
// Rays by the driver: VK_KHR_ray_tracing_pipeline, over queues in planes.
#include <optional>

#include "accel/rt_pipeline.h"
#include "accel/rt_world.h"
#include "accel/tracer.h"
#include "device/error.h"
#include "shared/scene_records.h"

namespace kuafu {
namespace {

std::shared_ptr<ks::Device> check_device(std::shared_ptr<ks::Device> device) {
  if (device->info().capabilities & KS_CAP_RAY_TRACING_PIPELINE) return device;
  ks::fail(KS_ERROR_UNSUPPORTED,
           "KUAFU_TRACER_RT_PIPELINE needs VK_KHR_ray_tracing_pipeline, VK_KHR_acceleration_structure and VK_KHR_deferred_host_operations, "
           "which %s (%s) lacks: use KUAFU_TRACER_AUTO%s",
           device->info().name, device->info().driver, device->is_cpu() ? ", or a newer lavapipe: Mesa 25.0 has them" : "");
}

class RtTracer final : public Tracer {
 public:
  explicit RtTracer(std::shared_ptr<ks::Device> device) : device_(check_device(device)), pipeline_(device), world_(std::move(device)) {}

  [[nodiscard]] const char* name() const override { return "rt pipeline"; }
  [[nodiscard]] uint32_t queue_layout() const override { return queue_layout_planes; }
  [[nodiscard]] uint32_t trace_group_size() const override { return 1; }  // a launch counts rays, not groups

  void update(const Scene& scene, uint32_t environment_count, const TimeSpan& open) override {
    world_.update(scene, environment_count, open);
  }
  void closest(ks::Commands& commands, const RayQueue& rays) override { run(commands, rays, RtPipeline::closest); }
  void occluded(ks::Commands& commands, const RayQueue& rays) override { run(commands, rays, RtPipeline::occluded); }

 private:
  void run(ks::Commands& commands, const RayQueue& rays, RtPipeline::Entry entry) {
    if (world_.environment_count() == 0) ks::fail(KS_ERROR_INVALID_STATE, "the tracer has not seen a scene yet: call update first");
    const RtPush push{rays.words->address(),
                      rays.environments ? rays.environments->address() : 0,
                      rays.counters->address() + rays.count_offset,
                      world_.top_levels(),
                      rays.scene,
                      rays.capacity,
                      world_.environment_count(),
                      rays.environments ? 1u : 0u};
    if (world_.record(commands)) commands.begin_stage("trace closest");  // the first rays after an update are a camera's
    if (rays.scene != 0 && !cutout_pipeline_) cutout_pipeline_.emplace(device_, true);
    const RtPipeline& pipeline = rays.scene != 0 ? *cutout_pipeline_ : pipeline_;
    pipeline.trace(commands, entry, push, *rays.counters, rays.arguments_offset);
  }

  std::shared_ptr<ks::Device> device_;
  RtPipeline pipeline_;
  std::optional<RtPipeline> cutout_pipeline_;  // once a scene has such surfaces
  RtWorld world_;
};

}  // namespace

std::unique_ptr<Tracer> make_rt_tracer(std::shared_ptr<ks::Device> device) { return std::make_unique<RtTracer>(std::move(device)); }

}  // namespace kuafu
