// SPDX-License-Identifier: Apache-2.0
#include "render/accumulation.h"

#include "shared/wave.h"

namespace kuafu {

void Accumulation::begin(const Shape& shape, bool continues, uint32_t first_sample) {
  if (continues && sums_ && shape == shape_) return;
  clear();
  shape_ = shape;
  first_sample_ = first_sample;
  const uint64_t planes = uint64_t(shape.channels) * (shape.groups + (shape.replicates ? replicate_count : 0));
  sums_ = ks::Buffer::create(memory_.device, planes * pixel_count() * 4, memory_.device->is_cpu() ? KS_BUFFER_HOST_VISIBLE : 0);
}

}  // namespace kuafu
