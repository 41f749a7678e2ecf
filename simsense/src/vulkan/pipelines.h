// The matcher's compute pipelines, built for one plan.
#pragma once

#include <optional>

#include "device/compute.h"
#include "vulkan/plan.h"

namespace simsense {

struct MatchPipelines {
  MatchPipelines(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  ks::ComputePipeline census;
  std::optional<ks::ComputePipeline> block_cost;  // where the block is more than one pixel
  ks::ComputePipeline paths, winner, finish;
};

}  // namespace simsense
