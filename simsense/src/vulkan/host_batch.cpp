#include "vulkan/host_batch.h"

#include <algorithm>
#include <cstring>

#include "device/error.h"

namespace simsense {

VulkanHostBatch::VulkanHostBatch(const std::shared_ptr<ks::Device>& device, uint32_t width, uint32_t height, uint32_t batch,
                                 const MatchParameters& parameters, const MatchTuning& tuning)
    : width_(width), height_(height), matcher_(make_vulkan_matcher(device, width, height, batch, parameters, tuning)) {
  const uint64_t pixels = uint64_t{width} * height * batch;
  left_ = ks::Buffer::create(device, pixels, KS_BUFFER_HOST_VISIBLE);
  right_ = ks::Buffer::create(device, pixels, KS_BUFFER_HOST_VISIBLE);
  disparity_ = ks::Buffer::create(device, pixels * sizeof(float), KS_BUFFER_HOST_VISIBLE);
}

void VulkanHostBatch::put(uint32_t n, ConstImage left, ConstImage right) {
  if (left.element_bytes != 1 || right.element_bytes != 1)
    ks::fail(KS_ERROR_UNSUPPORTED, "the Vulkan matcher takes 8-bit images: use the CPU back end");
  const auto copy = [&](ConstImage from, ks::Buffer& to) {
    for (size_t y = 0; y < height_; ++y)
      std::memcpy(static_cast<uint8_t*>(to.mapped()) + (n * height_ + y) * width_, from.data + static_cast<ptrdiff_t>(y) * from.row_stride,
                  width_);
  };
  copy(left, *left_);
  copy(right, *right_);
}

namespace {

class VulkanHostMatcher final : public Matcher {
 public:
  VulkanHostMatcher(const std::shared_ptr<ks::Device>& device, uint32_t width, uint32_t height, const MatchParameters& parameters,
                    const MatchTuning& tuning)
      : pixels_(size_t{width} * height), batch_(device, width, height, 1, parameters, tuning) {}

  void match(ConstImage left, ConstImage right, const MatchMaps& maps) override {
    if (maps.confidence || maps.reason)
      ks::fail(KS_ERROR_UNSUPPORTED, "the Vulkan matcher gives disparities alone: use the CPU back end for confidence and reasons");
    batch_.put(0, left, right);
    batch_.match();
    std::copy_n(batch_.disparity(0), pixels_, maps.disparity);
  }

  [[nodiscard]] std::vector<ks_stage_time> stage_times() const override { return batch_.stage_times(); }

 private:
  size_t pixels_;
  VulkanHostBatch batch_;
};

}  // namespace

std::unique_ptr<Matcher> make_vulkan_host_matcher(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height,
                                                  const MatchParameters& parameters, const MatchTuning& tuning) {
  return std::make_unique<VulkanHostMatcher>(device, width, height, parameters, tuning);
}

}  // namespace simsense
