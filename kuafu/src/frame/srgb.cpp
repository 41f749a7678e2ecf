// SPDX-License-Identifier: Apache-2.0
#include "frame/srgb.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "spirv/srgb.h"

namespace kuafu {
namespace {

constexpr float quarter_of_white = 0.25f;
constexpr float smallest = std::numeric_limits<float>::min();  // devices may take what is below for 0

/// IEC 61966-2-1, the other way: light of an encoded value.
double light_of(double encoded) { return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4); }

/// Bits of the smallest float whose encoded value rounds to `byte`.
uint32_t first_bits(uint32_t byte) {
  const double light = light_of((byte - 0.5) / 255.0);
  const auto nearest = float(light);
  return std::bit_cast<uint32_t>(double(nearest) < light ? std::nextafter(nearest, 1.0f) : nearest);
}

void fill_curve(std::span<uint32_t> curve) {
  uint32_t byte = 0;
  for (size_t i = 0; i < curve.size(); ++i) {
    const auto upper = uint32_t(srgb_first_entry + i);
    const uint32_t start = byte < 255 && first_bits(byte + 1) >> 16 == upper ? first_bits(byte + 1) & 0xffffu : srgb_no_start;
    curve[i] = byte << srgb_byte_shift | start;
    if (start != srgb_no_start) ++byte;
  }
}

/// For the middle of each class.
void fill_exposures(std::span<float> exposures) {
  for (size_t i = 0; i < exposures.size(); ++i) {
    const auto light = std::bit_cast<float>(uint32_t(i << light_class_shift | 1u << (light_class_shift - 1)));
    exposures[i] = std::max(float(quarter_of_white / std::max(light, smallest)), smallest);
  }
}

uint32_t looked_at(uint32_t pixels) { return (pixels + light_stride - 1) / light_stride; }

}  // namespace

SrgbEncoder::SrgbEncoder(Memory memory) : memory_(std::move(memory)), step_(memory_, srgb_spirv, host::srgb) {}

void SrgbEncoder::run(ks::Commands& commands, uint64_t radiance, const OutputRecord& to, uint32_t views, uint32_t width, uint32_t height) {
  if (!lights_) {
    fill_curve(curve_.resize(memory_, srgb_last_entry - srgb_first_entry + 1));
    fill_exposures(exposures_.resize(memory_, light_classes));
    grow(memory_, lights_, lights_words);
  }
  SrgbPush push{.from = radiance,
                .to = to,
                .curve = curve_.address(),
                .exposures = exposures_.address(),
                .lights = memory_.address(*lights_),
                .step = srgb_encode,
                .count = views * width * height,
                .width = width,
                .height = height,
                .exposure = to.scale > 0.0f ? std::max(to.scale, smallest) : 0.0f,
                .reserved = 0};
  if (to.scale == 0.0f) {
    if (memory_.on_host)
      std::memset(lights_->mapped(), 0, lights_words * 4);
    else
      commands.fill(*lights_, 0, lights_words * 4, 0);
    SrgbPush count = push, choose = push;
    count.step = srgb_count, count.count = views * looked_at(width) * looked_at(height);
    choose.step = srgb_choose, choose.count = 1;
    step_.run(commands, "srgb", count);
    step_.run(commands, "srgb", choose);
  }
  step_.run(commands, "srgb", push);
}

}  // namespace kuafu
