// SPDX-License-Identifier: Apache-2.0
// The stages of some pairs in Vulkan compute: each records its work on the caller's device buffers. Images that nothing changes stay where
// they are; scratch memory is kept between calls. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <optional>

#include "stages/stages.h"
#include "vulkan/checks/checks.h"
#include "vulkan/depth/depth.h"
#include "vulkan/frame.h"
#include "vulkan/maps.h"
#include "vulkan/matcher.h"
#include "vulkan/rectify/remap.h"
#include "vulkan/registration/registration.h"
#include "vulkan/signal/imager.h"

namespace simsense {

class VulkanStages final : public Stages {
 public:
  /// rig must outlive this.
  VulkanStages(std::shared_ptr<ks::Device> device, const PreparedRig& rig);

  /// Whether this call can use the last call's arrays. Recorded work may then still be under way.
  [[nodiscard]] bool keeps_arrays(const StageSettings& settings) const;
  /// Makes the arrays of this call's disparities. No work may be under way unless keeps_arrays().
  void prepare(const StageSettings& settings, const Needs& needs);
  /// Uploads the settings; call once per submission, before its pairs.
  void begin(ks::Commands& commands, const StageSettings& settings);
  /// Records all stages of at most pairs_at_once() pairs.
  void record(ks::Commands& commands, const StageSettings& settings, const DeviceFrame& frame, const Pairs& pairs);
  [[nodiscard]] uint32_t pairs_at_once() const;
  /// Call after recorded work that was never submitted: its uploads are repeated.
  void discard() { imagers_.reset(); }
  /// Bytes of device memory, without the caller's buffers and the tables.
  [[nodiscard]] uint64_t memory_bytes() const;

  void signal() override;
  void rectify() override;
  MatchStages& matcher() override;
  void place_region() override;
  void drop_padding() override { checks_.drop_padding(checked(), *remap_); }
  void drop_low_texture() override { checks_.drop_low_texture(checked(), images_[0]); }
  void filter_speckles() override { checks_.filter_speckles(checked()); }
  void drop_edges() override { checks_.drop_edges(checked()); }
  void fill_holes() override { checks_.fill_holes(checked()); }
  void depth() override;
  void registration() override;
  void points() override {}
  void reason() override { checks_.reason(checked(), depth_->block(), images_[0]); }
  void store_maps() override;
  [[nodiscard]] bool makes_points_apart() const override { return false; }
  void measure(const char* name, const std::function<void()>& run) override;

 private:
  /// The arguments of record().
  struct Call {
    ks::Commands& commands;
    const StageSettings& settings;
    const DeviceFrame& frame;
    Pairs pairs;
  };
  /// The settings that the matcher and its maps were made for.
  struct Matching {
    MatchParameters parameters;
    Region wanted, used;
    bool operator==(const Matching&) const = default;
  };
  ImageRef measure_side(uint32_t side);
  ImageRef rectify_side(uint32_t side);
  ImageRef scratch(std::shared_ptr<ks::Buffer>& buffer);
  void copy(const ImageRef& from, const ImageRef& to);
  [[nodiscard]] VulkanChecks::Call checked() const { return {call_->commands, call_->settings, maps_, call_->pairs.count}; }
  [[nodiscard]] ImageRef output(uint32_t which) const { return ref_or_none(call_->frame.outputs[which], call_->pairs); }

  std::shared_ptr<ks::Device> device_;
  const PreparedRig& rig_;
  uint32_t width_, height_;
  std::optional<Call> call_;  // while record() runs
  ImageRef images_[2] = {};   // as the last stage leaves them
  MatchArrays arrays_;
  DeviceMaps maps_;
  VulkanChecks checks_;

  std::unique_ptr<VulkanRemap> remap_;  // where the pair is not rectified already
  // made when first needed
  std::optional<VulkanImagers> imagers_;
  std::optional<ks::ComputePipeline> copy_;
  std::shared_ptr<ks::Buffer> counts_[2], rectified_[2];
  Matching matching_;
  std::unique_ptr<VulkanMatcher> matcher_;
  std::optional<VulkanMaps> match_maps_;
  std::optional<VulkanDepth> depth_;
  std::optional<VulkanRegistration> registration_;
};

}  // namespace simsense
