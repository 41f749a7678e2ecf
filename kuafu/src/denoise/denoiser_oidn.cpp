// SPDX-License-Identifier: Apache-2.0
// Here Open Image Denoise takes the place of the filter: image after image, view after view, on the host.
#include "denoise/denoiser.h"

namespace kuafu {
namespace {

/// Makes [count][3] of one or three channels.
std::vector<float> three_channels(const std::vector<float>& values, uint32_t channels) {
  if (channels == 3) return values;
  std::vector<float> out;
  for (const float value : values) out.insert(out.end(), 3, value);
  return out;
}

void read_guides(const ks::Buffer& buffer, uint32_t first, uint32_t count, OidnImages& images) {
  std::vector<glm::vec4> guides(guide_words(first + count) / 4);
  buffer.read(0, guides.data(), guides.size() * sizeof(glm::vec4));
  images.albedo.clear();
  images.normal.clear();
  for (uint32_t pixel = first; pixel < first + count; ++pixel)
    for (int i = 0; i < 3; ++i) {
      images.albedo.push_back(guides[guide_place(pixel, 2)][i]);
      images.normal.push_back(guides[guide_place(pixel, 0)][i]);
    }
}

}  // namespace

void Denoiser::filter_by_oidn(const Launch& launch, const Frame& frame) {
  if (!oidn_) oidn_ = std::make_unique<Oidn>(oidn_library_);
  const uint64_t pixels = uint64_t(launch.width) * launch.height;
  std::vector<float> values(pixels * channels_);
  OidnImages images;
  for (uint64_t view = 0; view < launch.views.size(); ++view) {
    read_guides(*guides_, uint32_t(view * pixels), uint32_t(pixels), images);
    for (const uint32_t kind : denoised_kinds(launch)) {
      ks::Buffer& image = frame.image(kind);
      const uint64_t offset_bytes = view * values.size() * sizeof(float);
      image.read(offset_bytes, values.data(), values.size() * sizeof(float));
      images.color = three_channels(values, channels_);
      oidn_->filter(images, launch.width, launch.height);
      for (size_t i = 0; i < values.size(); ++i) values[i] = images.output[channels_ == 3 ? i : 3 * i];
      image.write(offset_bytes, values.data(), values.size() * sizeof(float));
    }
  }
}

}  // namespace kuafu
