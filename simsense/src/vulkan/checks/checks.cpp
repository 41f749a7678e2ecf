// SPDX-License-Identifier: Apache-2.0
#include "vulkan/checks/checks.h"

#include "shared/clean_push.h"
#include "shared/map_push.h"
#include "spirv/edges.h"
#include "spirv/holes.h"
#include "spirv/padding.h"
#include "spirv/reason.h"
#include "spirv/speckle.h"
#include "spirv/speckle_tile.h"
#include "spirv/texture.h"
#include "vulkan/dispatch.h"

namespace simsense {
namespace {

CleanPush clean_push(const VulkanChecks::Call& call, uint32_t width, uint32_t height) {
  CleanPush push{};
  push.disparity = call.maps.disparity;
  push.confidence = call.maps.confidence;
  push.reason = call.maps.reason;
  push.maps = call.maps.flags();
  push.width = width;
  push.height = height;
  push.invalid = call.settings.invalid_disparity();
  push.max_diff_px = call.settings.speckle_max_diff_px;
  push.max_size = call.settings.speckle_max_size;
  push.filling = static_cast<uint32_t>(call.settings.hole_filling);
  push.x0 = call.settings.wanted.x0;
  push.y0 = call.settings.wanted.y0;
  push.x1 = call.settings.wanted.x1;
  push.y1 = call.settings.wanted.y1;
  return push;
}

}  // namespace

uint64_t VulkanChecks::reserved(std::shared_ptr<ks::Buffer>& buffer, const Call& call, uint64_t bytes) {
  reserve(device_, buffer, uint64_t{width_} * height_ * call.pairs * bytes);
  return buffer->address();
}

template <class Push>
void VulkanChecks::run(Pipeline& pipeline, std::span<const uint32_t> code, const Call& call, const Push& push, uint32_t width,
                       uint32_t height) {
  if (!pipeline) pipeline.emplace(*device_, code, sizeof push);
  dispatch_pixels(call.commands, *pipeline, push, width, height, call.pairs);
}

void VulkanChecks::drop_padding(const Call& call, const VulkanRemap& remap) {
  CleanPush push = clean_push(call, width_, height_);
  push.x = remap.left_x();
  push.y = remap.left_y();
  run(padding_, padding_spirv, call, push, width_, height_);
}

void VulkanChecks::drop_low_texture(const Call& call, const ImageRef& left) {
  TexturePush push{};
  push.disparity = call.maps.disparity;
  push.confidence = call.maps.confidence;
  push.reason = call.maps.reason;
  push.blank = reserved(blank_, call, 1);
  push.row_blank = reserved(row_blank_, call, 1);
  push.left = left;
  push.width = width_;
  push.height = height_;
  push.min_texture_dn = call.settings.texture.min_texture_dn;
  push.maps = call.maps.flags();
  push.invalid = call.settings.invalid_disparity();
  for (push.step = TEXTURE_PASS_FIND; push.step < TEXTURE_PASS_COUNT; ++push.step)
    run(texture_, texture_spirv, call, push, width_, height_);
}

void VulkanChecks::filter_speckles(const Call& call) {
  CleanPush push = clean_push(call, width_, height_);
  push.parent = reserved(parent_, call, sizeof(uint32_t));
  push.size = reserved(size_, call, sizeof(uint32_t));
  if (!speckle_tiles_) speckle_tiles_.emplace(*device_, speckle_tile_spirv, sizeof push);
  call.commands.dispatch(*speckle_tiles_, push, groups_of(width_, SPECKLE_TILE), groups_of(height_, SPECKLE_TILE), call.pairs);
  for (push.step = SPECKLE_JOIN; push.step < SPECKLE_PASSES; ++push.step) run(speckles_, speckle_spirv, call, push, width_, height_);
}

void VulkanChecks::drop_edges(const Call& call) {
  CleanPush push = clean_push(call, width_, height_);
  push.parent = reserved(marks_, call, sizeof(uint32_t));
  push.max_diff_px = call.settings.edges.step_px;
  push.max_size = call.settings.edges.border_px;
  for (push.step = EDGES_PASS_MARK; push.step < EDGES_PASS_COUNT; ++push.step) run(edges_, edges_spirv, call, push, width_, height_);
}

void VulkanChecks::fill_holes(const Call& call) {
  CleanPush push = clean_push(call, width_, height_);
  push.parent = reserved(guesses_, call, sizeof(uint32_t));
  for (push.step = HOLES_PASS_GUESS; push.step < HOLES_PASS_COUNT; ++push.step)
    run(holes_, holes_spirv, call, push, push.x1 - push.x0, push.y1 - push.y0);
}

void VulkanChecks::reason(const Call& call, uint64_t depth_block, const ImageRef& left) {
  ReasonPush push{};
  push.block = depth_block;
  push.disparity = call.maps.disparity;
  push.reason = call.maps.reason;
  push.left = left;
  push.window_width = call.settings.reason.window_width;
  push.window_height = call.settings.reason.window_height;
  push.low_texture_dn = call.settings.reason.low_texture_dn;
  push.saturated_dn = call.settings.reason.saturated_dn;
  run(reason_, reason_spirv, call, push, width_, height_);
}

uint64_t VulkanChecks::memory_bytes() const {
  uint64_t bytes = 0;
  for (const auto* buffer : {&blank_, &row_blank_, &parent_, &size_, &marks_, &guesses_}) bytes += *buffer ? (*buffer)->size_bytes() : 0;
  return bytes;
}

}  // namespace simsense
