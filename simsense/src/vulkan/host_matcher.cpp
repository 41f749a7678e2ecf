// SPDX-License-Identifier: Apache-2.0
// The Vulkan matcher behind the interface of host images: through host-visible buffers, one pair at a time.
#include <cstring>

#include "device/error.h"
#include "vulkan/matcher.h"

namespace simsense {
namespace {

class VulkanHostMatcher final : public Matcher {
 public:
  VulkanHostMatcher(const std::shared_ptr<ks::Device>& device, uint32_t width, uint32_t height, const MatchParameters& parameters,
                    const MatchTuning& tuning)
      : width_(width), height_(height), commands_(device), matcher_(make_vulkan_matcher(device, width, height, 1, parameters, tuning)) {
    const auto make = [&](uint64_t bytes) { return ks::Buffer::create(device, bytes * width * height, KS_BUFFER_HOST_VISIBLE); };
    for (auto& image : images_) image = make(2);
    disparity_ = make(4);
    confidence_ = make(4);
    reason_ = make(1);
  }

  void match(ConstImage left, ConstImage right, const MatchMaps& maps) override {
    if (left.element_bytes != right.element_bytes)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "left pixels have %u bytes, right ones %u: must be alike", left.element_bytes,
               right.element_bytes);
    put(left, *images_[0]);
    put(right, *images_[1]);
    MatchArrays arrays;
    arrays.left = images_[0]->address();
    arrays.right = images_[1]->address();
    arrays.element_bytes = left.element_bytes;
    arrays.noise = noise_;
    arrays.disparity = disparity_->address();
    arrays.confidence = maps.confidence ? confidence_->address() : 0;
    arrays.reason = maps.reason ? reason_->address() : 0;
    commands_.reset_stage_times();
    matcher_->record(commands_, arrays, 1);
    commands_.flush();
    const size_t pixels = width_ * height_;
    std::memcpy(maps.disparity, disparity_->mapped(), pixels * sizeof(float));
    if (maps.confidence) std::memcpy(maps.confidence, confidence_->mapped(), pixels * sizeof(float));
    if (maps.reason) std::memcpy(maps.reason, reason_->mapped(), pixels);
  }

  [[nodiscard]] std::vector<ks_stage_time> stage_times() const override { return to_stage_times(commands_.stage_times()); }

 private:
  void put(ConstImage from, ks::Buffer& to) const {
    const size_t row_bytes = width_ * from.element_bytes;
    for (size_t y = 0; y < height_; ++y)
      std::memcpy(static_cast<uint8_t*>(to.mapped()) + y * row_bytes,
                  from.data + static_cast<ptrdiff_t>(y) * from.row_stride * static_cast<ptrdiff_t>(from.element_bytes), row_bytes);
  }

  size_t width_, height_;
  ks::Commands commands_;
  std::unique_ptr<VulkanMatcher> matcher_;
  std::shared_ptr<ks::Buffer> images_[2], disparity_, confidence_, reason_;
};

}  // namespace

std::unique_ptr<Matcher> make_vulkan_host_matcher(const std::shared_ptr<ks::Device>& device, uint32_t width, uint32_t height,
                                                  const MatchParameters& parameters, const MatchTuning& tuning) {
  return std::make_unique<VulkanHostMatcher>(device, width, height, parameters, tuning);
}

}  // namespace simsense
