// SPDX-License-Identifier: Apache-2.0
#include "cpu/signal/imager.h"

#include <algorithm>
#include <array>

namespace simsense::cpu {
namespace {

constexpr size_t stripe_columns = 64;
using Stripe = std::array<float, stripe_columns>;

/// One row takes what its room allows from the charge that flows by.
void absorb(float* charge, Stripe& flow, size_t columns, float full_well) {
  for (size_t x = 0; x < columns; ++x) {
    const float taken = std::min(flow[x], std::max(full_well - charge[x], 0.0f));
    charge[x] += taken;
    flow[x] -= taken;
  }
}

/// Columns of one stripe. The overflow of a row is kept above its full well until both flows have taken their halves.
void bloom_stripe(float* charge, size_t columns, size_t height, size_t pitch, float full_well, float share) {
  Stripe flow{};
  const auto add_half_overflow = [&](const float* row) {
    for (size_t x = 0; x < columns; ++x) flow[x] += 0.5f * share * std::max(row[x] - full_well, 0.0f);
  };
  for (size_t y = 0; y < height; ++y) {
    absorb(charge + y * pitch, flow, columns, full_well);
    add_half_overflow(charge + y * pitch);
  }
  flow.fill(0);
  for (size_t y = height; y-- > 0;) {
    float* row = charge + y * pitch;
    absorb(row, flow, columns, full_well);
    add_half_overflow(row);
    for (size_t x = 0; x < columns; ++x) row[x] = std::min(row[x], full_well);
  }
}

}  // namespace

void bloom(float* charge_e, size_t width, size_t height, size_t pitch, float full_well_e, float share, ks::ThreadPool& workers) {
  workers.parallel_for((width + stripe_columns - 1) / stripe_columns, [&](size_t stripe) {
    const size_t first = stripe * stripe_columns;
    bloom_stripe(charge_e + first, std::min(stripe_columns, width - first), height, pitch, full_well_e, share);
  });
}

}  // namespace simsense::cpu
