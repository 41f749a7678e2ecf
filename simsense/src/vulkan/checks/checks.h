// SPDX-License-Identifier: Apache-2.0
// The checks after the matcher in Vulkan compute: the bits of cpu/checks, and the reason out_of_range. Pipelines and scratch memory are
// made when they are first needed. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "device/compute.h"
#include "stages/settings.h"
#include "vulkan/maps.h"
#include "vulkan/rectify/remap.h"

namespace simsense {

class VulkanChecks {
 public:
  /// The maps of some pairs that all checks share.
  struct Call {
    ks::Commands& commands;
    const StageSettings& settings;
    const DeviceMaps& maps;
    uint32_t pairs;
  };

  VulkanChecks(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height)
      : device_(std::move(device)), width_(width), height_(height) {}

  /// Rejects pixels whose source position lies outside the source image.
  void drop_padding(const Call& call, const VulkanRemap& remap);
  /// Rejects pixels where the left image, as the matcher read it, is blank.
  void drop_low_texture(const Call& call, const ImageRef& left);
  void filter_speckles(const Call& call);
  /// Rejects pixels beside a step of disparity, and matches at the right image's edges.
  void drop_edges(const Call& call);
  void fill_holes(const Call& call);
  /// Finds out why pixels have no depth. depth_block: VulkanDepth::block().
  void reason(const Call& call, uint64_t depth_block, const ImageRef& left);
  [[nodiscard]] uint64_t memory_bytes() const;

 private:
  using Pipeline = std::optional<ks::ComputePipeline>;
  /// Address of a buffer with `bytes` for each pixel of the pairs.
  uint64_t reserved(std::shared_ptr<ks::Buffer>& buffer, const Call& call, uint64_t bytes);
  template <class Push>
  void run(Pipeline& pipeline, std::span<const uint32_t> code, const Call& call, const Push& push, uint32_t width, uint32_t height);

  std::shared_ptr<ks::Device> device_;
  uint32_t width_, height_;
  Pipeline padding_, texture_, speckle_tiles_, speckles_, edges_, holes_, reason_;
  std::shared_ptr<ks::Buffer> blank_, row_blank_, parent_, size_, marks_, guesses_;  // parent, size: union-find of islands
};

}  // namespace simsense
