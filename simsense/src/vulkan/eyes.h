// From the caller's light to what the matcher sees, in Vulkan compute: signal and rectification of both eyes of some pairs, the IR and
// rectified images for the caller on the way. Images that nothing changes stay where they are. Thread rule: externally synchronised.
#pragma once

#include <optional>

#include "frame.h"
#include "vulkan/device_image.h"
#include "vulkan/imager.h"
#include "vulkan/rectifier.h"

namespace simsense {

using DeviceFrame = FrameOf<DeviceImage>;

/// Some pairs of a batch.
struct Pairs {
  uint32_t first = 0, count = 0;
};

class VulkanEyes {
 public:
  /// rectifier: nullptr where the pair comes rectified; outlives this.
  VulkanEyes(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, const VulkanRectifier* rectifier);

  struct Settings {
    const Imager (&imagers)[2];
    bool wide;     // the matcher sees 16 bit
    bool nearest;  // of the rectification
  };
  /// Records one eye of keys.size() pairs. Returns the packed images for the matcher, 16 bit where `wide`.
  ImageRef record(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, uint32_t eye, const Settings& settings,
                  std::span<const NoiseKey> keys);
  /// After recorded work that was never submitted: what it was to upload is uploaded anew.
  void discard() { imagers_.reset(); }
  [[nodiscard]] uint64_t memory_bytes() const;

 private:
  ImageRef scratch(std::shared_ptr<ks::Buffer>& buffer, uint32_t pairs, bool wide);
  ImageRef measure(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, uint32_t eye, const Settings& settings,
                   std::span<const NoiseKey> keys);
  void copy(ks::Commands& commands, const ImageRef& from, const ImageRef& to, uint32_t pairs);

  std::shared_ptr<ks::Device> device_;
  uint32_t width_, height_;
  const VulkanRectifier* rectifier_;
  std::optional<VulkanImagers> imagers_;  // made when first needed
  std::optional<ks::ComputePipeline> copy_;
  std::shared_ptr<ks::Buffer> counts_[2], rectified_[2];
};

}  // namespace simsense
