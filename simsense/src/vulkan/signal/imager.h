// SPDX-License-Identifier: Apache-2.0
// The imagers in Vulkan compute: signal/imager.h for a whole batch of images in device memory. Counts equal the scalar reference's but for
// one count where a value lies within the device's rounding of a half, or a Poisson expansion misses by an electron.
// Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "device/compute.h"
#include "shared/signal_push.h"
#include "signal/imager.h"
#include "signal/key.h"

namespace simsense {

/// Irradiance images in device memory.
struct LightRefs {
  ImageRef all, laser;  // laser: may be absent
};

class VulkanImagers {
 public:
  VulkanImagers(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height);

  /// Records one camera's images, at most signal_pairs, with one key each. One of counts and ir may be absent (format 0).
  void record(ks::Commands& commands, uint32_t side, const Imager& imager, std::span<const NoiseKey> keys, const LightRefs& light,
              const ImageRef& counts, const ImageRef& ir);
  [[nodiscard]] uint64_t memory_bytes() const;

 private:
  SignalParameters parameters(const Imager& imager, uint32_t pairs);
  void update_tables(ks::Commands& commands, uint32_t side, const Imager& imager);
  void record_grain(ks::Commands& commands, SignalPush push, const SignalParameters& parameters, uint32_t pairs);
  uint64_t reserve(std::shared_ptr<ks::Buffer>& buffer, uint64_t floats);

  struct Side {
    std::shared_ptr<ks::Buffer> block;
    std::optional<simsense_signal> tables;  // whose tables the block holds
  };
  std::shared_ptr<ks::Device> device_;
  uint32_t width_, height_, pitch_;
  ks::ComputePipeline signal_;
  std::unique_ptr<ks::ComputePipeline> bloom_, grain_;  // made when first needed
  Side sides_[2];
  std::shared_ptr<ks::Buffer> charge_, normals_[2], along_rows_;
};

}  // namespace simsense
