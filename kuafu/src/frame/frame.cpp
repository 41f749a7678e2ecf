// SPDX-License-Identifier: Apache-2.0
#include "frame/frame.h"

#include <algorithm>

#include "device/error.h"
#include "spirv/write.h"

namespace kuafu {
namespace {

constexpr uint32_t most_unneeded = 4;  // launches that an image is kept for without need

OutputRecord callers(const Memory& memory, const OutputImage& image) {
  if (!image.buffer) return {};
  return {.words = memory.address(*image.buffer) + image.offset_bytes,
          .first = image.first,
          .view_stride = image.view_stride,
          .row_stride = image.row_stride,
          .enabled = 1,
          .format = image.format,
          .scale = image.scale};
}

}  // namespace

Frame::Frame(Memory memory) : memory_(std::move(memory)), write_(memory_, write_spirv, host::write), srgb_(memory_) {}

void Frame::fit(const Launch& launch) {
  for (uint32_t kind = 0; kind < output_kind_count; ++kind) {
    auto& [held, unneeded] = images_[kind];
    const uint64_t bytes = uint64_t(launch.pixel_count()) * launch.channels(kind) * 4;
    const bool wanted = needs(launch, kind);
    unneeded = wanted ? 0 : std::min(unneeded + 1, most_unneeded);
    if (held && (unneeded == most_unneeded || (wanted && held->size_bytes() < bytes))) held.reset();
    if (wanted && !held) held = new_image(bytes);
  }
  const auto outputs = outputs_.resize(memory_, output_kind_count);
  for (uint32_t kind = 0; kind < output_kind_count; ++kind) outputs[kind] = target(launch, kind);
}

/// Images that no launch needs now make room if memory is short.
std::shared_ptr<ks::Buffer> Frame::new_image(uint64_t bytes) {
  const uint32_t flags = memory_.device->is_cpu() ? KS_BUFFER_HOST_VISIBLE : 0;
  try {
    return ks::Buffer::create(memory_.device, bytes, flags);
  } catch (const ks::Error&) {
    for (HeldImage& image : images_)
      if (image.unneeded > 0) image.buffer.reset();
    return ks::Buffer::create(memory_.device, bytes, flags);
  }
}

bool Frame::is_empty() const {
  for (uint32_t kind = 0; kind < output_kind_count; ++kind)
    if (holds(kind)) return false;
  return true;
}

OutputRecord Frame::target(const Launch& launch, uint32_t kind) const {
  if (!holds(kind)) return callers(memory_, launch.outputs[kind]);
  const int row = int(launch.width * launch.channels(kind));
  return {.words = address(kind),
          .first = 0,
          .view_stride = row * int(launch.height),
          .row_stride = row,
          .enabled = 1,
          .format = is_integer(kind) ? format_u32 : format_f32,
          .scale = 1.0f};
}

void Frame::deliver(ks::Commands& commands, const Launch& launch) {
  for (uint32_t kind = 0; kind < output_kind_count; ++kind) {
    const bool sums = kind == output_projector;
    if (!launch.outputs[kind].buffer || kind == output_srgb || (!sums && !holds(kind))) continue;
    write_.run(commands, "write",
               {.from = address(sums ? output_projector_direct : kind),
                .to = callers(memory_, launch.outputs[kind]),
                .count = launch.pixel_count(),
                .width = launch.width,
                .height = launch.height,
                .channels = launch.channels(kind),
                .integer = is_integer(kind) ? 1u : 0u,
                .sums = sums ? 1u : 0u,
                .second = sums ? address(output_projector_indirect) : 0});
  }
  if (launch.outputs[output_srgb].buffer)
    srgb_.run(commands, address(output_radiance), callers(memory_, launch.outputs[output_srgb]), uint32_t(launch.views.size()),
              launch.width, launch.height);
}

}  // namespace kuafu
