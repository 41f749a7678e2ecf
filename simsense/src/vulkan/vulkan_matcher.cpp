#include "vulkan/vulkan_matcher.h"

#include <algorithm>
#include <cstring>

#include "device/error.h"
#include "shared/match_push.h"
#include "vulkan/dispatch.h"
#include "vulkan/pipelines.h"

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

struct VulkanMatcher::State {
  State(std::shared_ptr<ks::Device> d, uint32_t batch_count, const MatchParameters& p, const MatchTuning& tuning, uint32_t width,
        uint32_t height)
      : device(std::move(d)),
        batch(batch_count),
        parameters(p),
        plan(make_match_plan(*device, width, height, batch, p, tuning)),
        pipelines(device, plan, p),
        commands(device) {
    left_census = allocate((plan.pixels() + 2 * left_margin) * plan.census_words * 4);
    right_census = allocate(plan.right_copy_words() * plan.census_copies * plan.census_words * 4);
    if (parameters.p2_full_gradient > 0) gray = allocate((plan.pixels() + 2 * left_margin) * 4);
    if (plan.cost_volume_bytes() > 0) cost = allocate(plan.cost_volume_bytes());
    for (uint32_t i = 0; i < plan.sum_volumes; ++i) sums[i] = allocate(plan.sum_volume_bytes());
    right_winner = allocate(plan.pixels() * 4);
    unchecked = allocate(plan.pixels() * 4);
  }

  std::shared_ptr<ks::Buffer> allocate(uint64_t bytes) {
    memory_bytes += bytes;
    return ks::Buffer::create(device, bytes, 0);
  }

  [[nodiscard]] CensusPush census_push(const MatchArrays& arrays) const;
  [[nodiscard]] PathPush path_push() const;
  [[nodiscard]] WinnerPush winner_push(const MatchArrays& arrays) const;
  [[nodiscard]] FinishPush finish_push(const MatchArrays& arrays) const;
  void record(ks::Commands& on, const MatchArrays& arrays, uint32_t pairs);
  void record_paths(ks::Commands& on, uint32_t pairs);

  std::shared_ptr<ks::Device> device;
  uint32_t batch;
  MatchParameters parameters;
  MatchPlan plan;
  MatchPipelines pipelines;
  ks::Commands commands;
  std::shared_ptr<ks::Buffer> left_census, right_census, gray, cost, sums[4], right_winner, unchecked;  // as in match_push.h
  uint64_t memory_bytes = 0;
};

CensusPush VulkanMatcher::State::census_push(const MatchArrays& arrays) const {
  CensusPush push{};
  push.left_image = arrays.left & ~uint64_t{3};
  push.right_image = arrays.right & ~uint64_t{3};
  push.left_byte = arrays.left & 3;
  push.right_byte = arrays.right & 3;
  push.image_pitch = arrays.image_pitch ? arrays.image_pitch : plan.width;
  push.image_stride = arrays.image_stride ? arrays.image_stride : plan.width * plan.height;
  push.left_census = left_census->address();
  push.right_census = right_census->address();
  push.gray = gray ? gray->address() : 0;
  push.right_winner = right_winner->address();
  push.width = plan.width;
  push.height = plan.height;
  push.right_pitch = plan.right_pitch;
  push.right_origin = plan.right_origin;
  push.right_copy_words = static_cast<uint32_t>(plan.right_copy_words());
  push.min_disparity = parameters.min_disparity;
  return push;
}

PathPush VulkanMatcher::State::path_push() const {
  PathPush push{};
  push.left_census = left_census->address();
  push.right_census = right_census->address();
  push.gray = gray ? gray->address() : 0;
  push.cost = cost ? cost->address() : 0;
  push.first_sums = sums[0]->address();
  push.second_sums = sums[plan.sum_volumes == 1 ? 0 : 1]->address();
  push.width = plan.width;
  push.height = plan.height;
  push.right_origin = plan.right_origin;
  push.right_pitch = plan.right_pitch;
  push.right_copy_words = static_cast<uint32_t>(plan.right_copy_words());
  push.p1 = plan.p1;
  push.p2 = plan.p2;
  push.p2_full_gradient = parameters.p2_full_gradient;
  return push;
}

uint32_t maps_of(const MatchArrays& arrays) { return (arrays.confidence ? MATCH_CONFIDENCE : 0u) | (arrays.reason ? MATCH_REASON : 0u); }

WinnerPush VulkanMatcher::State::winner_push(const MatchArrays& arrays) const {
  WinnerPush push{};
  for (uint32_t i = 0; i < plan.sum_volumes; ++i) push.sums[i] = sums[i]->address();
  push.cost = cost ? cost->address() : 0;
  push.left_census = left_census->address();
  push.right_census = right_census->address();
  push.right_winner = right_winner->address();
  push.unchecked = unchecked->address();
  push.confidence = arrays.confidence;
  push.width = plan.width;
  push.height = plan.height;
  push.right_origin = plan.right_origin;
  push.right_pitch = plan.right_pitch;
  push.min_disparity = parameters.min_disparity;
  push.maps = maps_of(arrays);
  return push;
}

FinishPush VulkanMatcher::State::finish_push(const MatchArrays& arrays) const {
  FinishPush push{};
  push.right_winner = right_winner->address();
  push.unchecked = unchecked->address();
  push.disparity = arrays.disparity;
  push.confidence = arrays.confidence;
  push.reason = arrays.reason;
  push.width = plan.width;
  push.height = plan.height;
  push.lr_max_diff = parameters.lr_max_diff;
  push.min_disparity = parameters.min_disparity;
  push.maps = maps_of(arrays);
  return push;
}

/// Where a dispatch adds to what another leaves, it waits for that.
void VulkanMatcher::State::record_paths(ks::Commands& on, uint32_t pairs) {
  PathPush push = path_push();
  const uint32_t lines = plan.path_group / plan.path_lanes / 2;
  uint32_t row_groups = groups_of(plan.height, lines), column_groups = 4 * groups_of(plan.width, 4 * lines);
  if (plan.sums_blocks()) {
    row_groups = groups_of(plan.height, plan.summed_lines - (parameters.block_height - 1));
    column_groups = groups_of(plan.width, plan.summed_lines - (parameters.block_width - 1));
  }
  on.set_automatic_barriers(plan.sum_volumes == 1);
  on.dispatch(pipelines.paths, push, row_groups + (plan.rows_apart ? 0 : column_groups), 1, pairs);
  if (pipelines.columns) on.dispatch(*pipelines.columns, push, column_groups, 1, pairs);
  if (pipelines.diagonals) {
    if (plan.sum_volumes == 2) on.barrier();
    if (plan.sum_volumes == 4) push.first_sums = sums[2]->address(), push.second_sums = sums[3]->address();
    on.dispatch(*pipelines.diagonals, push, 2 * column_groups, 1, pairs);
  }
  on.set_automatic_barriers(true);
  on.barrier();
}

void VulkanMatcher::State::record(ks::Commands& on, const MatchArrays& arrays, uint32_t pairs) {
  const uint32_t w = plan.width, h = plan.height;
  on.begin_stage("census");
  on.dispatch(pipelines.census(device, plan, parameters, arrays.element_bytes), census_push(arrays),
              groups_of(plan.right_origin, 64) + groups_of(w, 64), groups_of(h, 16), 2 * pairs);
  if (pipelines.block_cost) {
    on.begin_stage("block cost");
    const uint32_t part_groups = plan.padded_disparities() / 8 / plan.block_group_parts;
    const uint32_t outputs = plan.block_columns() - (parameters.block_width - 1);
    on.dispatch(*pipelines.block_cost, path_push(), part_groups * groups_of(w, outputs), groups_of(h, plan.block_rows_per_group), pairs);
  }
  on.begin_stage("paths");
  record_paths(on, pairs);
  on.begin_stage("winner");
  on.dispatch(pipelines.winner, winner_push(arrays), groups_of(h, plan.winner_group / plan.path_lanes), plan.segments, pairs);
  on.begin_stage("check and median");
  dispatch_pixels(on, pipelines.finish, finish_push(arrays), w, h, pairs);
}

VulkanMatcher::VulkanMatcher(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, uint32_t batch,
                             const MatchParameters& parameters, const MatchTuning& tuning)
    : state_(std::make_unique<State>(std::move(device), batch, parameters, tuning, width, height)) {}

VulkanMatcher::~VulkanMatcher() = default;

void VulkanMatcher::match(const DeviceImages& left, const DeviceImages& right, const DeviceImages& disparity) {
  State& s = *state_;
  const uint64_t pixels = uint64_t{s.plan.width} * s.plan.height * s.batch;
  check_images(left, pixels, "left images");
  check_images(right, pixels, "right images");
  check_images(disparity, pixels * 4, "disparities");
  if (disparity.offset_bytes % 4 != 0)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "disparities start at byte %llu: must be a multiple of 4",
             static_cast<unsigned long long>(disparity.offset_bytes));
  s.commands.reset_stage_times();
  const uint64_t image_pixels = uint64_t{s.plan.width} * s.plan.height;
  const auto at = [](const DeviceImages& images, uint64_t bytes) { return images.buffer.address() + images.offset_bytes + bytes; };
  for (uint32_t pair = 0; pair < s.batch; pair += s.plan.pairs_at_once) {
    const uint64_t first = pair * image_pixels;
    MatchArrays arrays;
    arrays.left = at(left, first);
    arrays.right = at(right, first);
    arrays.disparity = at(disparity, 4 * first);
    record(s.commands, arrays, std::min(s.plan.pairs_at_once, s.batch - pair));
  }
  s.commands.flush();
}

void VulkanMatcher::record(ks::Commands& commands, const MatchArrays& arrays, uint32_t pairs) { state_->record(commands, arrays, pairs); }

std::vector<ks_stage_time> to_stage_times(const std::vector<std::pair<std::string, double>>& times) {
  std::vector<ks_stage_time> out;
  for (const auto& [name, milliseconds] : times) {
    ks_stage_time& time = out.emplace_back();
    std::strncpy(time.name, name.c_str(), sizeof time.name - 1);
    time.milliseconds = milliseconds;
  }
  return out;
}

std::vector<ks_stage_time> VulkanMatcher::stage_times() const { return to_stage_times(state_->commands.stage_times()); }

uint64_t VulkanMatcher::memory_bytes() const { return state_->memory_bytes; }

const MatchPlan& VulkanMatcher::plan() const { return state_->plan; }

std::string why_not_vulkan(const ks::Device& device, uint32_t width, uint32_t height, uint32_t batch, const MatchParameters& parameters) {
  constexpr VkSubgroupFeatureFlags needed = VK_SUBGROUP_FEATURE_BASIC_BIT | VK_SUBGROUP_FEATURE_VOTE_BIT |
                                            VK_SUBGROUP_FEATURE_ARITHMETIC_BIT | VK_SUBGROUP_FEATURE_BALLOT_BIT |
                                            VK_SUBGROUP_FEATURE_SHUFFLE_BIT | VK_SUBGROUP_FEATURE_SHUFFLE_RELATIVE_BIT;
  if (!device.has_vulkan()) return "the host device has no Vulkan";
  VkPhysicalDeviceVulkan12Features features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
  VkPhysicalDeviceFeatures2 all_features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &features};
  vkGetPhysicalDeviceFeatures2(device.physical(), &all_features);
  if (!features.storageBuffer8BitAccess) return "storage buffers of 8 bit are missing";
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
