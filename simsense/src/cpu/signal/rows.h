// SPDX-License-Identifier: Apache-2.0
// The imager's stages on one row of pixels, vectorised. Buffers hold the row's width rounded up to row_padding, and are aligned to 64
// bytes. Thread rule: pure functions.
#pragma once

#include <cstddef>
#include <cstdint>

#include "signal/gamma_quantile.h"
#include "signal/key.h"
#include "simsense/simsense.h"

namespace simsense::cpu {

inline constexpr size_t row_padding = 64;

/// The factor table of a part of the speckle, and the row's standard normals if grains are correlated; null means white.
struct SpeckleRow {
  const GammaTable* table = nullptr;
  const float* normals = nullptr;
};

struct SignalRow {
  const simsense_signal& signal;
  const StreamKeys& keys;
  uint32_t y = 0;
  size_t width = 0;           // padded
  uint32_t* words = nullptr;  // scratch, [width]
  float* scratch = nullptr;   // [width]
  float* values = nullptr;    // [width]; irradiance in, charge out, then charge in
  float* laser = nullptr;     // [width]; the irradiance that has speckle; null: all has
};

/// Converts the input's units to collected charge, e-: exposure, speckle, PRNU, dark charge, shot noise.
void collect_row(const SignalRow& row, const SpeckleRow& static_speckle, const SpeckleRow& temporal_speckle);

/// Converts charge to counts: readout noise, amplifier, response, converter. counts: [width]; uint8_t if bit_depth is 8, else uint16_t;
/// float is neither rounded nor clipped.
void read_out_row(const SignalRow& row, uint8_t* counts);
void read_out_row(const SignalRow& row, uint16_t* counts);
void read_out_row(const SignalRow& row, float* counts);

/// Computes standard normals of columns x0 .. x0 + width of row y. x0: a multiple of 4, may be negative; so may y, as its two's complement.
void normal_row(const PhiloxKey& key, Dimension dimension, int32_t x0, uint32_t y, size_t width, uint32_t* words, float* normals);

/// Computes sums[x] = sum over k of weights[k] * values[k * step + x], for x < width.
void weigh_row(const float* values, size_t step, const float* weights, size_t weight_count, size_t width, float* sums);

}  // namespace simsense::cpu
