// The Vulkan matcher behind the interface of host images: one pair at a time through host-visible buffers.
#include <cstring>

#include "device/error.h"
#include "vulkan/vulkan_matcher.h"

namespace simsense {
namespace {

class VulkanHostMatcher final : public Matcher {
 public:
  VulkanHostMatcher(const std::shared_ptr<ks::Device>& device, uint32_t width, uint32_t height, const MatchParameters& parameters,
                    const MatchTuning& tuning)
      : width_(width),
        height_(height),
        matcher_(make_vulkan_matcher(device, width, height, 1, parameters, tuning)),
        left_(ks::Buffer::create(device, uint64_t{width} * height, KS_BUFFER_HOST_VISIBLE)),
        right_(ks::Buffer::create(device, uint64_t{width} * height, KS_BUFFER_HOST_VISIBLE)),
        disparity_(ks::Buffer::create(device, uint64_t{width} * height * sizeof(float), KS_BUFFER_HOST_VISIBLE)) {}

  void match(ConstImage left, ConstImage right, const MatchMaps& maps) override {
    if (maps.confidence || maps.reason || left.element_bytes != 1 || right.element_bytes != 1)
      ks::fail(KS_ERROR_UNSUPPORTED, "the Vulkan matcher takes 8-bit images and gives disparities alone: match on the host device");
    copy_rows(left, *left_);
    copy_rows(right, *right_);
    matcher_->match({*left_}, {*right_}, {*disparity_});
    std::memcpy(maps.disparity, disparity_->mapped(), disparity_->size_bytes());
  }

  [[nodiscard]] std::vector<ks_stage_time> stage_times() const override { return matcher_->stage_times(); }

 private:
  void copy_rows(ConstImage from, ks::Buffer& to) const {
    for (size_t y = 0; y < height_; ++y)
      std::memcpy(static_cast<uint8_t*>(to.mapped()) + y * width_, from.data + static_cast<ptrdiff_t>(y) * from.row_stride, width_);
  }

  size_t width_, height_;
  std::unique_ptr<VulkanMatcher> matcher_;
  std::shared_ptr<ks::Buffer> left_, right_, disparity_;
};

}  // namespace

std::unique_ptr<Matcher> make_vulkan_host_matcher(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height,
                                                  const MatchParameters& parameters, const MatchTuning& tuning) {
  return std::make_unique<VulkanHostMatcher>(device, width, height, parameters, tuning);
}

}  // namespace simsense
