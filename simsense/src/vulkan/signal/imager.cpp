// SPDX-License-Identifier: Apache-2.0
#include "vulkan/signal/imager.h"

#include <algorithm>
#include <cstddef>

#include "device/error.h"
#include "signal/imager.h"
#include "spirv/bloom.h"
#include "spirv/grain.h"
#include "spirv/signal.h"

namespace simsense {
namespace {

constexpr uint32_t quads_per_group = 32, rows_per_group = 4, grain_tile = 256, bloom_columns = 64;  // as in the shaders

uint32_t groups(uint32_t items, uint32_t per_group) { return (items + per_group - 1) / per_group; }

SignalKeys signal_keys(const NoiseKey& key) {
  const StreamKeys streams(key);
  const auto pair = [](const PhiloxKey& k) { return SignalKey{k[0], k[1]}; };
  return {pair(streams.frame), pair(streams.scene), pair(streams.sensor)};
}

bool same_tables(const simsense_signal& a, const simsense_signal& b) {
  return a.speckle_shape == b.speckle_shape && a.speckle_scale == b.speckle_scale && a.speckle_correlation == b.speckle_correlation &&
         a.speckle_psf_sigma_px == b.speckle_psf_sigma_px;
}

uint32_t grain_radius(const simsense_signal& s) {
  return s.speckle_psf_sigma_px > 0 ? static_cast<uint32_t>(grain_kernel(s.speckle_psf_sigma_px).size() / 2) : 0;
}

}  // namespace

VulkanImagers::VulkanImagers(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height)
    : device_(std::move(device)),
      width_(width),
      height_(height),
      pitch_(groups(width, 4) * 4),
      signal_(*device_, signal_spirv, sizeof(SignalPush)) {
  for (Side& side : sides_) side.block = ks::Buffer::create(device_, sizeof(SignalBlock), 0);
}

uint64_t VulkanImagers::reserve(std::shared_ptr<ks::Buffer>& buffer, uint64_t floats) {
  if (!buffer || buffer->size_bytes() < floats * sizeof(float)) buffer = ks::Buffer::create(device_, floats * sizeof(float), 0);
  return buffer->address();
}

SignalParameters VulkanImagers::parameters(const Imager& imager, uint32_t pairs) {
  const simsense_signal& s = imager.signal();
  SignalParameters p{};
  p.width = width_;
  p.height = height_;
  p.pitch = pitch_;
  p.speckle_parts = (imager.static_speckle().empty() ? 0u : 1u) | (imager.temporal_speckle().empty() ? 0u : 2u);
  p.grain_radius = p.speckle_parts ? grain_radius(s) : 0;
  const uint64_t floats = uint64_t{pitch_} * height_ * pairs;
  if (imager.blooms()) p.charge = reserve(charge_, floats);
  if (p.grain_radius > 0) {
    // Room for the widest PSF at once: both cameras of one recording use it, so it must not grow between them.
    p.along_rows = reserve(along_rows_, uint64_t{pitch_} * (height_ + grain_taps - 1) * pairs);
    for (uint32_t part : {0u, 1u})
      if (p.speckle_parts >> part & 1u) p.normals[part] = reserve(normals_[part], floats);
  }
  p.electrons_per_unit = s.responsivity_e * s.exposure_s;
  p.prnu = s.prnu;
  p.dark_e = s.dark_current_e_per_s * dark_exposure_s(s);
  p.hot_share = s.hot_pixel_share;
  p.hot_mean_e = s.hot_pixel_e_per_s * dark_exposure_s(s);
  p.shot_noise = s.shot_noise;
  p.full_well_e = s.full_well_e;
  p.bloom_share = s.blooming;
  p.dsnu_e = s.dsnu_e;
  p.row_fixed_e = s.row_fixed_e;
  p.column_fixed_e = s.column_fixed_e;
  p.row_noise_e = s.row_noise_e;
  p.column_noise_e = s.column_noise_e;
  p.read_noise_e = s.read_noise_e;
  p.dn_per_e = s.conversion_gain_dn_per_e * s.gain;
  p.response_exponent = s.response_exponent;
  p.max_dn = max_dn(s);
  p.adc_noise_dn = s.adc_noise_dn;
  p.black_dn = black_dn(s);
  return p;
}

/// Tables change with the speckle alone, so they stay in the block until it does.
void VulkanImagers::update_tables(ks::Commands& commands, uint32_t side, const Imager& imager) {
  const simsense_signal& s = imager.signal();
  if (s.speckle_shape == 0 || (sides_[side].tables && same_tables(*sides_[side].tables, s))) return;
  SignalTables tables{};
  if (s.speckle_psf_sigma_px > 0) std::ranges::copy(grain_kernel(s.speckle_psf_sigma_px), tables.grain_weights);
  const auto copy_table = [&](const GammaTable& table, uint32_t part) {
    static_assert(sizeof(GammaInterval) == sizeof(GammaTable::Interval) && gamma_intervals == GammaTable::interval_count + 1);
    if (!table.empty())
      std::transform(table.intervals(), table.intervals() + gamma_intervals, tables.gamma + part * gamma_intervals,
                     [](const GammaTable::Interval& i) {
                       return GammaInterval{i.start, i.slope};
                     });
  };
  copy_table(imager.static_speckle(), 0);
  copy_table(imager.temporal_speckle(), 1);
  commands.update(*sides_[side].block, offsetof(SignalBlock, tables), &tables, sizeof tables);
  sides_[side].tables = s;
}

void VulkanImagers::record_grain(ks::Commands& commands, SignalPush push, const SignalParameters& p, uint32_t pairs) {
  if (!grain_) grain_ = std::make_unique<ks::ComputePipeline>(*device_, grain_spirv, sizeof(SignalPush));
  for (uint32_t part : {0u, 1u}) {
    if (!(p.speckle_parts >> part & 1u)) continue;
    push.passes = part;
    push.columns = 0;
    commands.dispatch(*grain_, push, groups(pitch_, grain_tile), height_ + 2 * p.grain_radius, pairs);
    push.columns = 1;
    commands.dispatch(*grain_, push, groups(pitch_, grain_tile), height_, pairs);
  }
}

void VulkanImagers::record(ks::Commands& commands, uint32_t side, const Imager& imager, std::span<const NoiseKey> keys,
                           const LightRefs& light, const ImageRef& counts, const ImageRef& ir) {
  if (keys.size() > signal_pairs) ks::fail(KS_ERROR_INTERNAL, "%zu images at once: at most %u", keys.size(), signal_pairs);
  const auto pairs = static_cast<uint32_t>(keys.size());
  SignalHead head{};
  head.parameters = parameters(imager, pairs);
  if (head.parameters.speckle_parts != 0) head.parameters.laser = light.laser;
  std::ranges::transform(keys, head.keys, signal_keys);
  commands.update(*sides_[side].block, offsetof(SignalBlock, head), &head, sizeof head);
  update_tables(commands, side, imager);
  SignalPush push{};
  push.block = sides_[side].block->address();
  push.light = light.all;
  push.counts = counts;
  push.ir = ir;
  if (head.parameters.grain_radius > 0) record_grain(commands, push, head.parameters, pairs);
  const auto pass = [&](uint32_t passes) {
    push.passes = passes;
    commands.dispatch(signal_, push, groups(width_, 4 * quads_per_group), groups(height_, rows_per_group), pairs);
  };
  if (!imager.blooms()) return pass(SIGNAL_COLLECT | SIGNAL_READ_OUT);
  if (!bloom_) bloom_ = std::make_unique<ks::ComputePipeline>(*device_, bloom_spirv, sizeof(SignalPush));
  pass(SIGNAL_COLLECT);
  push.passes = 0;
  commands.dispatch(*bloom_, push, groups(width_, bloom_columns), 1, pairs);
  pass(SIGNAL_READ_OUT);
}

uint64_t VulkanImagers::memory_bytes() const {
  uint64_t bytes = 0;
  for (const auto* buffer : {&sides_[0].block, &sides_[1].block, &charge_, &normals_[0], &normals_[1], &along_rows_})
    if (*buffer) bytes += (*buffer)->size_bytes();
  return bytes;
}

}  // namespace simsense
