// The path tracer's compute pipelines; each is built when it is first used. Thread rule: externally synchronised.
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "device/compute.h"
#include "pathtrace/path_tracer.h"

namespace kuafu {

struct PathTracer::Pipelines {
  Pipelines(std::shared_ptr<ks::Device> device, const Tracer& tracer);
  const ks::ComputePipeline& generate();
  const ks::ComputePipeline& shade(bool infrared);
  const ks::ComputePipeline& resolve();
  const ks::ComputePipeline& accumulate();
  const ks::ComputePipeline& aov();

  [[nodiscard]] uint32_t groups(uint32_t invocations) const { return (invocations + group_size - 1) / group_size; }
  uint32_t group_size;

 private:
  const ks::ComputePipeline& built(std::optional<ks::ComputePipeline>& slot, std::span<const uint32_t> spirv, size_t push_bytes);

  std::shared_ptr<ks::Device> device_;
  std::array<uint32_t, 3> specialisation_;  // workgroup size, queue layout, the tracer's workgroup size
  std::optional<ks::ComputePipeline> generate_, shade_infrared_, shade_visible_, resolve_, accumulate_, aov_;
};

}  // namespace kuafu
