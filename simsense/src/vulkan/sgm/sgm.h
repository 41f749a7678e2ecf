// SPDX-License-Identifier: Apache-2.0
// The paths of semi-global matching in Vulkan compute: rows, columns and diagonals into the plan's volumes of path costs.
#pragma once

#include <optional>

#include "device/compute.h"
#include "vulkan/match_arrays.h"

namespace simsense {

class VulkanSgm {
 public:
  /// plan and parameters must outlive this.
  VulkanSgm(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  void record(ks::Commands& commands, const MatchBuffers& buffers, uint32_t pairs) const;

 private:
  const MatchPlan& plan_;
  const MatchParameters& parameters_;
  ks::ComputePipeline paths_;  // rows and columns, or rows alone
  std::optional<ks::ComputePipeline> columns_, diagonals_;
};

}  // namespace simsense
