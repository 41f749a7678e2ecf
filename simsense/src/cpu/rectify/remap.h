// SPDX-License-Identifier: Apache-2.0
// Resampling through a RemapTable. Bilinear: a tap outside the source reads 0; the sum is rounded to nearest, halves to even.
// Thread rule: pure functions; the result does not depend on the number of workers.
#pragma once

#include "match/matcher.h"
#include "rectify/rectification.h"

namespace simsense {

/// Resamples an image bilinearly. source, out: table.width x table.height elements of source.element_bytes; out is packed.
void remap(const RemapTable& table, const ConstImage& source, void* out, ks::ThreadPool& workers);

/// Resamples an image by the nearest pixel, with halves away from zero; beyond the source its edge repeats (SIMSENSE_FAULT_REMAP_NEAREST).
void remap_nearest(const RemapTable& table, const ConstImage& source, void* out, ks::ThreadPool& workers);

}  // namespace simsense
