#include "pathtrace/frame.h"

namespace kuafu {
namespace {

OutputRecord callers(const Memory& memory, const OutputImage& image) {
  if (!image.buffer) return {};
  return {
      memory.address(*image.buffer) + image.offset_bytes, image.first, image.view_stride, image.row_stride, 1, image.format, image.scale};
}

}  // namespace

void Frame::fit(const Launch& launch) {
  for (uint32_t kind = 0; kind < output_kind_count; ++kind) {
    std::shared_ptr<ks::Buffer>& held = images_[kind];
    const uint64_t bytes = uint64_t(launch.pixel_count()) * launch.channels(kind) * 4;
    const bool wanted = needs(launch, kind);
    if (held && (!wanted || held->size_bytes() < bytes)) held.reset();
    if (wanted && !held) held = ks::Buffer::create(memory_.device, bytes, memory_.device->is_cpu() ? KS_BUFFER_HOST_VISIBLE : 0);
  }
}

bool Frame::is_empty() const {
  for (const auto& image : images_)
    if (image) return false;
  return true;
}

OutputRecord Frame::target(const Launch& launch, uint32_t kind) const {
  if (!holds(kind)) return callers(memory_, launch.outputs[kind]);
  const int row = int(launch.width * launch.channels(kind));
  return {address(kind), 0, row * int(launch.height), row, 1, is_integer(kind) ? format_u32 : format_f32, 1.0f};
}

WritePush Frame::write(const Launch& launch, uint32_t kind) const {
  return {address(kind),
          callers(memory_, launch.outputs[kind]),
          launch.pixel_count(),
          launch.width,
          launch.height,
          launch.channels(kind),
          is_integer(kind) ? 1u : 0u};
}

}  // namespace kuafu
