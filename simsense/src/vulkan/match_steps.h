// SPDX-License-Identifier: Apache-2.0
// The matcher's steps in Vulkan compute, each with its pipelines; their definitions lie in the folders of their names.
#pragma once

#include <memory>
#include <optional>

#include "device/compute.h"
#include "vulkan/match_arrays.h"

namespace simsense {

/// What all steps share; plan and parameters must outlive them.
struct VulkanStep {
  std::shared_ptr<ks::Device> device_;
  const MatchPlan& plan_;
  const MatchParameters& parameters_;
};

/// The census of both images of some pairs: the words of cpu/census, both images' and the right one's shifted copies.
struct VulkanCensus : private VulkanStep {
  explicit VulkanCensus(const VulkanStep& step);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs);

 private:
  ks::ComputePipeline of_bytes_;
  std::optional<ks::ComputePipeline> of_words_;  // of 16-bit images, made when first needed
};

/// Hamming costs summed over a block, into a volume; only where plan.stored_costs.
struct VulkanBlockCost : private VulkanStep {
  explicit VulkanBlockCost(const VulkanStep& step);
  void record(ks::Commands& commands, const MatchBuffers& buffers, uint32_t pairs) const;

 private:
  ks::ComputePipeline pipeline_;
};

/// The paths of semi-global matching: rows, columns and diagonals into the plan's volumes of path costs.
struct VulkanSgm : private VulkanStep {
  explicit VulkanSgm(const VulkanStep& step);
  void record(ks::Commands& commands, const MatchBuffers& buffers, uint32_t pairs) const;

 private:
  ks::ComputePipeline paths_;  // rows and columns, or rows alone
  std::optional<ks::ComputePipeline> columns_, diagonals_;
};

/// Winners of the left and the right image, uniqueness, subpixel step and confidence.
struct VulkanWinner : private VulkanStep {
  explicit VulkanWinner(const VulkanStep& step);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const;

 private:
  ks::ComputePipeline pipeline_;
};

/// Left-right check and median of the matcher's disparities, with the resulting changes of the other maps.
struct VulkanMedian : private VulkanStep {
  explicit VulkanMedian(const VulkanStep& step);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const;

 private:
  ks::ComputePipeline pipeline_;
};

/// The refinement of disparities by the images' counts (match/refine.h).
struct VulkanRefinement : private VulkanStep {
  explicit VulkanRefinement(const VulkanStep& step);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const;

 private:
  struct Passes {
    Passes(const ks::Device& device, uint32_t element_bytes);
    ks::ComputePipeline cells, move, windows;
  };
  Passes of_bytes_, of_words_;
};

/// The check that both images show more than noise (match/detection.h).
struct VulkanDetection : private VulkanStep {
  explicit VulkanDetection(const VulkanStep& step);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const;

 private:
  ks::ComputePipeline of_bytes_, of_words_, detection_, bare_;
};

}  // namespace simsense
