// SPDX-License-Identifier: Apache-2.0
#include "cpu/signal/imager.h"

#include <algorithm>
#include <optional>

#include "cpu/signal/rows.h"
#include "cpu/simd/buffer.h"
#include "device/error.h"
#include "ks/image.h"

namespace simsense::cpu {
namespace {

constexpr size_t band_rows = 8;

template <class T>
void load_as(const ConstPlane& input, uint32_t width, uint32_t y, float* row) {
  if (input.pixel_stride == sizeof(T)) {
    const std::byte* first = input.data + static_cast<ptrdiff_t>(y) * input.row_stride;
    for (uint32_t x = 0; x < width; ++x) {
      T value;
      __builtin_memcpy(&value, first + x * sizeof(T), sizeof(T));
      row[x] = static_cast<float>(value);
    }
    return;
  }
  for (uint32_t x = 0; x < width; ++x) row[x] = static_cast<float>(input.at<T>(x, y));
}

void load_row(const ConstPlane& input, uint32_t width, uint32_t y, float* row) {
  switch (input.format) {
    case KS_FORMAT_U8:
      return load_as<uint8_t>(input, width, y, row);
    case KS_FORMAT_U16:
      return load_as<uint16_t>(input, width, y, row);
    case KS_FORMAT_F32:
      return load_as<float>(input, width, y, row);
    default:
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "input format %u: the imager reads u8 (1), u16 (2) or f32 (6)", input.format);
  }
}

/// A part of the speckle and, where it is grainy, its normals.
struct SpecklePart {
  const GammaTable* table = nullptr;
  std::optional<Buffer<float>> normals;

  SpecklePart(const GammaTable& gamma, const PhiloxKey& key, Dimension dimension, float sigma_px, size_t pitch, size_t height,
              ks::ThreadPool& workers) {
    if (gamma.empty()) return;
    table = &gamma;
    if (sigma_px > 0) normals = grain_normals(key, dimension, sigma_px, pitch, height, workers);
  }
  [[nodiscard]] SpeckleRow row(size_t y, size_t pitch) const { return {table, normals ? normals->data() + y * pitch : nullptr}; }
};

/// Memory of one thread's rows.
template <class Count>
struct RowMemory {
  Buffer<uint32_t> words;
  Buffer<float> scratch, values, laser;
  Buffer<Count> counts;

  RowMemory(size_t pitch, bool has_laser) : words(pitch), scratch(pitch), values(pitch), laser(has_laser ? pitch : 0), counts(pitch) {}
};

template <class F>
void for_bands(size_t height, ks::ThreadPool& workers, F&& f) {
  workers.parallel_for((height + band_rows - 1) / band_rows,
                       [&](size_t band) { f(band * band_rows, std::min(height, (band + 1) * band_rows)); });
}

}  // namespace

template <class Count>
void measure(const Imager& imager, const NoiseKey& key, const Irradiance& light, uint32_t width, uint32_t height, Count* counts,
             ks::ThreadPool& workers) {
  const simsense_signal& signal = imager.signal();
  const StreamKeys keys(key);
  const size_t pitch = round_up(width, row_padding);
  const float sigma_px = signal.speckle_psf_sigma_px;
  const SpecklePart fixed(imager.static_speckle(), keys.scene, Dimension::speckle_static, sigma_px, pitch, height, workers);
  const SpecklePart temporal(imager.temporal_speckle(), keys.frame, Dimension::speckle_temporal, sigma_px, pitch, height, workers);
  const bool blooms = imager.blooms(), has_laser = light.laser && signal.speckle_shape > 0;
  Buffer<float> charge(blooms ? pitch * height : 0);

  const auto row_at = [&](size_t y, RowMemory<Count>& memory) {
    float* values = blooms ? charge.data() + y * pitch : memory.values.data();
    float* laser = has_laser ? memory.laser.data() : nullptr;
    return SignalRow{signal, keys, static_cast<uint32_t>(y), pitch, memory.words.data(), memory.scratch.data(), values, laser};
  };
  const auto collect = [&](const SignalRow& row) {
    load_row(light.all, width, row.y, row.values);
    if (row.laser) load_row(*light.laser, width, row.y, row.laser);
    collect_row(row, fixed.row(row.y, pitch), temporal.row(row.y, pitch));
  };
  const auto read_out = [&](const SignalRow& row, RowMemory<Count>& memory) {
    read_out_row(row, memory.counts.data());
    std::copy_n(memory.counts.data(), width, counts + size_t{row.y} * width);
  };
  for_bands(height, workers, [&](size_t begin, size_t end) {
    RowMemory<Count> memory(pitch, has_laser);
    for (size_t y = begin; y < end; ++y) {
      const SignalRow row = row_at(y, memory);
      collect(row);
      if (!blooms) read_out(row, memory);
    }
  });
  if (!blooms) return;
  bloom(charge.data(), width, height, pitch, signal.full_well_e, signal.blooming, workers);
  for_bands(height, workers, [&](size_t begin, size_t end) {
    RowMemory<Count> memory(pitch, has_laser);
    for (size_t y = begin; y < end; ++y) read_out(row_at(y, memory), memory);
  });
}

template void measure(const Imager&, const NoiseKey&, const Irradiance&, uint32_t, uint32_t, uint8_t*, ks::ThreadPool&);
template void measure(const Imager&, const NoiseKey&, const Irradiance&, uint32_t, uint32_t, uint16_t*, ks::ThreadPool&);
template void measure(const Imager&, const NoiseKey&, const Irradiance&, uint32_t, uint32_t, float*, ks::ThreadPool&);

}  // namespace simsense::cpu
