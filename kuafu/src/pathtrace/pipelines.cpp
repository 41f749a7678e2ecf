#include "pathtrace/pipelines.h"

#include "shared/wave.h"
#include "spirv/accumulate.h"
#include "spirv/aov.h"
#include "spirv/generate.h"
#include "spirv/resolve.h"
#include "spirv/shade_infrared.h"
#include "spirv/shade_visible.h"

namespace kuafu {

// Workgroup sizes that measured best on lavapipe and on an NVIDIA GPU.
PathTracer::Pipelines::Pipelines(std::shared_ptr<ks::Device> device, const Tracer& tracer)
    : group_size(device->is_cpu() ? 128 : 64),
      device_(std::move(device)),
      specialisation_{group_size, tracer.queue_layout(), tracer.trace_group_size()} {}

const ks::ComputePipeline& PathTracer::Pipelines::built(std::optional<ks::ComputePipeline>& slot, std::span<const uint32_t> spirv,
                                                        size_t push_bytes) {
  if (!slot) slot.emplace(device_, spirv, uint32_t(push_bytes), specialisation_);
  return *slot;
}

const ks::ComputePipeline& PathTracer::Pipelines::generate() { return built(generate_, generate_spirv, sizeof(GeneratePush)); }
const ks::ComputePipeline& PathTracer::Pipelines::shade(bool infrared) {
  return infrared ? built(shade_infrared_, shade_infrared_spirv, sizeof(ShadePush))
                  : built(shade_visible_, shade_visible_spirv, sizeof(ShadePush));
}
const ks::ComputePipeline& PathTracer::Pipelines::resolve() { return built(resolve_, resolve_spirv, sizeof(ResolvePush)); }
const ks::ComputePipeline& PathTracer::Pipelines::accumulate() { return built(accumulate_, accumulate_spirv, sizeof(AccumulatePush)); }
const ks::ComputePipeline& PathTracer::Pipelines::aov() { return built(aov_, aov_spirv, sizeof(AovPush)); }

}  // namespace kuafu
