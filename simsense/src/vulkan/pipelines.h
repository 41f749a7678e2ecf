// The matcher's compute pipelines, built for one plan.
#pragma once

#include <optional>

#include "device/compute.h"
#include "vulkan/plan.h"

namespace simsense {

struct MatchPipelines {
  MatchPipelines(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  /// For images of 1 or 2 bytes per pixel.
  const ks::ComputePipeline& census(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters,
                                    uint32_t element_bytes);

  ks::ComputePipeline census_8;
  std::optional<ks::ComputePipeline> census_16;   // of 16-bit images, made when first needed
  std::optional<ks::ComputePipeline> block_cost;  // where costs are stored
  ks::ComputePipeline paths;                      // rows and columns, or rows alone
  std::optional<ks::ComputePipeline> columns, diagonals;
  ks::ComputePipeline winner, finish;
};

}  // namespace simsense
