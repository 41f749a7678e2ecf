#include "signal/imager.h"

#include <algorithm>
#include <optional>

#include "cpu/buffer.h"
#include "cpu/signal/rows.h"
#include "device/error.h"
#include "device/thread_pool.h"
#include "ks/image.h"
#include "signal/blooming.h"
#include "signal/dark.h"
#include "signal/grain.h"

namespace simsense {
namespace {

constexpr size_t band_rows = 8;

bool has_noise(const simsense_signal& s) {
  return s.speckle_shape > 0 || s.prnu > 0 || s.shot_noise > 0 || s.dsnu_e > 0 || s.row_fixed_e > 0 || s.column_fixed_e > 0 ||
         s.row_noise_e > 0 || s.column_noise_e > 0 || s.read_noise_e > 0 || s.adc_noise_dn > 0;
}

bool is_identity(const simsense_signal& s) {
  const bool has_dark = s.dark_current_e_per_s > 0 || (s.hot_pixel_share > 0 && s.hot_pixel_e_per_s > 0);
  const float gains = s.responsivity_e * s.exposure_s * (s.conversion_gain_dn_per_e * s.gain);
  return !has_noise(s) && !has_dark && gains == 1 && s.full_well_e == 0 && s.response_exponent == 1 && black_dn(s) == 0 && s.bit_depth == 8;
}

bool has_same_speckle(const simsense_signal& a, const simsense_signal& b) {
  return a.speckle_shape == b.speckle_shape && a.speckle_scale == b.speckle_scale && a.speckle_correlation == b.speckle_correlation;
}

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
  std::optional<cpu::Buffer<float>> normals;

  SpecklePart(const GammaTable& gamma, const PhiloxKey& key, Dimension dimension, float sigma_px, size_t pitch, size_t height,
              ks::ThreadPool& workers) {
    if (gamma.empty()) return;
    table = &gamma;
    if (sigma_px > 0) normals = grain_normals(key, dimension, sigma_px, pitch, height, workers);
  }
  [[nodiscard]] cpu::SpeckleRow row(size_t y, size_t pitch) const { return {table, normals ? normals->data() + y * pitch : nullptr}; }
};

/// Memory of one thread's rows.
template <class Count>
struct RowMemory {
  cpu::Buffer<uint32_t> words;
  cpu::Buffer<float> scratch, values, laser;
  cpu::Buffer<Count> counts;

  RowMemory(size_t pitch, bool has_laser) : words(pitch), scratch(pitch), values(pitch), laser(has_laser ? pitch : 0), counts(pitch) {}
};

template <class F>
void for_bands(size_t height, ks::ThreadPool& workers, F&& f) {
  workers.parallel_for((height + band_rows - 1) / band_rows,
                       [&](size_t band) { f(band * band_rows, std::min(height, (band + 1) * band_rows)); });
}

}  // namespace

Imager::Imager(const simsense_signal& signal, const Imager* former) : signal_(signal), is_neutral_(is_identity(signal)) {
  const double shape = signal.speckle_shape, fixed = signal.speckle_correlation;
  if (former && has_same_speckle(signal, former->signal_)) {
    static_speckle_ = former->static_speckle_;
    temporal_speckle_ = former->temporal_speckle_;
    return;
  }
  if (shape * fixed > 0) static_speckle_ = GammaTable(shape * fixed, signal.speckle_scale);
  if (shape * (1 - fixed) > 0) temporal_speckle_ = GammaTable(shape * (1 - fixed), signal.speckle_scale);
}

template <class Count>
void Imager::measure(const NoiseKey& key, const Irradiance& light, uint32_t width, uint32_t height, Count* counts,
                     ks::ThreadPool& workers) const {
  const StreamKeys keys(key);
  const size_t pitch = cpu::round_up(width, cpu::row_padding);
  const float sigma_px = signal_.speckle_psf_sigma_px;
  const SpecklePart fixed(static_speckle_, keys.scene, Dimension::speckle_static, sigma_px, pitch, height, workers);
  const SpecklePart temporal(temporal_speckle_, keys.frame, Dimension::speckle_temporal, sigma_px, pitch, height, workers);
  const bool blooms = signal_.full_well_e > 0 && signal_.blooming > 0, has_laser = light.laser && signal_.speckle_shape > 0;
  cpu::Buffer<float> charge(blooms ? pitch * height : 0);

  const auto row_at = [&](size_t y, RowMemory<Count>& memory) {
    float* values = blooms ? charge.data() + y * pitch : memory.values.data();
    float* laser = has_laser ? memory.laser.data() : nullptr;
    return cpu::SignalRow{signal_, keys, static_cast<uint32_t>(y), pitch, memory.words.data(), memory.scratch.data(), values, laser};
  };
  const auto collect = [&](const cpu::SignalRow& row) {
    load_row(light.all, width, row.y, row.values);
    if (row.laser) load_row(*light.laser, width, row.y, row.laser);
    cpu::collect_row(row, fixed.row(row.y, pitch), temporal.row(row.y, pitch));
  };
  const auto read_out = [&](const cpu::SignalRow& row, RowMemory<Count>& memory) {
    cpu::read_out_row(row, memory.counts.data());
    std::copy_n(memory.counts.data(), width, counts + size_t{row.y} * width);
  };
  for_bands(height, workers, [&](size_t begin, size_t end) {
    RowMemory<Count> memory(pitch, has_laser);
    for (size_t y = begin; y < end; ++y) {
      const cpu::SignalRow row = row_at(y, memory);
      collect(row);
      if (!blooms) read_out(row, memory);
    }
  });
  if (!blooms) return;
  bloom(charge.data(), width, height, pitch, signal_.full_well_e, signal_.blooming, workers);
  for_bands(height, workers, [&](size_t begin, size_t end) {
    RowMemory<Count> memory(pitch, has_laser);
    for (size_t y = begin; y < end; ++y) read_out(row_at(y, memory), memory);
  });
}

template void Imager::measure(const NoiseKey&, const Irradiance&, uint32_t, uint32_t, uint8_t*, ks::ThreadPool&) const;
template void Imager::measure(const NoiseKey&, const Irradiance&, uint32_t, uint32_t, uint16_t*, ks::ThreadPool&) const;

}  // namespace simsense
