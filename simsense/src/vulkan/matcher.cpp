// SPDX-License-Identifier: Apache-2.0
#include "vulkan/matcher.h"

#include <algorithm>
#include <cstring>

#include "device/error.h"

namespace simsense {
namespace {

void check_images(const DeviceImages& images, uint64_t bytes, const char* name) {
  const uint64_t size = images.buffer.size_bytes();
  if (images.offset_bytes > size || bytes > size - images.offset_bytes)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s: %llu bytes at offset %llu leave the buffer of %llu bytes", name,
             static_cast<unsigned long long>(bytes), static_cast<unsigned long long>(images.offset_bytes),
             static_cast<unsigned long long>(size));
}

}  // namespace

VulkanMatcher::VulkanMatcher(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, uint32_t batch,
                             const MatchParameters& parameters, const MatchTuning& tuning)
    : device_(std::move(device)),
      batch_(batch),
      parameters_(parameters),
      plan_(make_match_plan(*device_, width, height, batch, parameters, tuning)),
      buffers_(device_, plan_, parameters_),
      step_{device_, plan_, parameters_},
      census_(step_),
      sgm_(step_),
      winner_(step_),
      median_(step_),
      own_commands_(device_) {
  if (plan_.stored_costs) cost_.emplace(step_);
  if (parameters_.refines()) refinement_.emplace(step_);
  if (parameters_.detects()) detection_.emplace(step_);
}

void VulkanMatcher::begin(ks::Commands& commands, const MatchArrays& arrays, uint32_t pairs) {
  commands_ = &commands;
  arrays_ = arrays;
  pairs_ = pairs;
}

void VulkanMatcher::census() { census_.record(*commands_, buffers_, arrays_, pairs_); }
void VulkanMatcher::cost() { cost_->record(*commands_, buffers_, pairs_); }
void VulkanMatcher::sgm() { sgm_.record(*commands_, buffers_, pairs_); }
void VulkanMatcher::winner() { winner_.record(*commands_, buffers_, arrays_, pairs_); }
void VulkanMatcher::checks() { median_.record(*commands_, buffers_, arrays_, pairs_); }
void VulkanMatcher::refine() { refinement_->record(*commands_, buffers_, arrays_, pairs_); }
void VulkanMatcher::detection() { detection_->record(*commands_, buffers_, arrays_, pairs_); }

void VulkanMatcher::record(ks::Commands& commands, const MatchArrays& arrays, uint32_t pairs) {
  begin(commands, arrays, pairs);
  run_match(*this, [&](const char* name, const auto& run) {
    commands.begin_stage(name);
    run();
  });
}

void VulkanMatcher::match(const DeviceImages& left, const DeviceImages& right, const DeviceImages& disparity) {
  const uint64_t pixels = uint64_t{plan_.width} * plan_.height * batch_;
  check_images(left, pixels, "left images");
  check_images(right, pixels, "right images");
  check_images(disparity, pixels * 4, "disparities");
  if (disparity.offset_bytes % 4 != 0)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "disparities start at byte %llu: must be a multiple of 4",
             static_cast<unsigned long long>(disparity.offset_bytes));
  own_commands_.reset_stage_times();
  const uint64_t image_pixels = uint64_t{plan_.width} * plan_.height;
  const auto at = [](const DeviceImages& images, uint64_t bytes) { return images.buffer.address() + images.offset_bytes + bytes; };
  for (uint32_t pair = 0; pair < batch_; pair += plan_.pairs_at_once) {
    const uint64_t first = pair * image_pixels;
    MatchArrays arrays;
    arrays.left = at(left, first);
    arrays.right = at(right, first);
    arrays.disparity = at(disparity, 4 * first);
    record(own_commands_, arrays, std::min(plan_.pairs_at_once, batch_ - pair));
  }
  own_commands_.flush();
}

std::vector<ks_stage_time> to_stage_times(const std::vector<std::pair<std::string, double>>& times) {
  std::vector<ks_stage_time> out;
  for (const auto& [name, milliseconds] : times) {
    ks_stage_time& time = out.emplace_back();
    std::strncpy(time.name, name.c_str(), sizeof time.name - 1);
    time.milliseconds = milliseconds;
  }
  return out;
}

std::vector<ks_stage_time> VulkanMatcher::stage_times() const { return to_stage_times(own_commands_.stage_times()); }

std::string why_not_vulkan(const ks::Device& device, uint32_t width, uint32_t height, uint32_t batch, const MatchParameters& parameters) {
  constexpr VkSubgroupFeatureFlags needed = VK_SUBGROUP_FEATURE_BASIC_BIT | VK_SUBGROUP_FEATURE_VOTE_BIT |
                                            VK_SUBGROUP_FEATURE_ARITHMETIC_BIT | VK_SUBGROUP_FEATURE_BALLOT_BIT |
                                            VK_SUBGROUP_FEATURE_SHUFFLE_BIT | VK_SUBGROUP_FEATURE_SHUFFLE_RELATIVE_BIT;
  if (!device.has_vulkan()) return "the host device has no Vulkan";
  if (!device.features12().storageBuffer8BitAccess) return "storage buffers of 8 bit are missing";
  VkPhysicalDeviceSubgroupProperties subgroup{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES};
  VkPhysicalDeviceProperties2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &subgroup};
  vkGetPhysicalDeviceProperties2(device.physical(), &all);
  if ((subgroup.supportedOperations & needed) != needed || !(subgroup.supportedStages & VK_SHADER_STAGE_COMPUTE_BIT))
    return "subgroups in compute lack vote, arithmetic, ballot or shuffle operations";
  if (device.subgroup_size() < 4 || device.subgroup_size() > 64) return "subgroups are not of 4 to 64 lanes";
  const uint64_t words = make_match_plan(device, width, height, batch, parameters, {}).largest_array_words();
  if (words > MatchPlan::most_array_words)
    return "its largest volume would have " + std::to_string(words) + " words, it reaches " + std::to_string(MatchPlan::most_array_words);
  return {};
}

std::unique_ptr<VulkanMatcher> make_vulkan_matcher(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, uint32_t batch,
                                                   const MatchParameters& parameters, const MatchTuning& tuning) {
  if (batch == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "batch is 0: must be at least 1");
  const std::string why_not = why_not_vulkan(*device, width, height, batch, parameters);
  if (!why_not.empty())
    ks::fail(KS_ERROR_UNSUPPORTED, "the Vulkan matcher cannot serve on %s: %s; use the CPU back end", device->info().name, why_not.c_str());
  return std::make_unique<VulkanMatcher>(std::move(device), width, height, batch, parameters, tuning);
}

}  // namespace simsense
