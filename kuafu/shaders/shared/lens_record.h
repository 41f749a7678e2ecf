// SPDX-License-Identifier: Apache-2.0
// A distorting lens (ks/lens.h), read by GLSL and C++ (scalar layout).
#ifndef KUAFU_LENS_RECORD_H
#define KUAFU_LENS_RECORD_H

#include "shared/arrays.h"
#include "shared/ray_queue.h"

#ifdef __cplusplus
namespace kuafu {
#endif

KUAFU_CONST lens_brown_conrady = 0u;
KUAFU_CONST lens_kannala_brandt = 1u;
KUAFU_CONST lens_straight = 2u;  // of a LensRecord alone: Brown and Conrady's without coefficients

KUAFU_CONST undistort_steps = 20u;  // of Newton, at most; a lens of a camera needs three

struct LensRecord {
  uint model;  // lens_*
  float k[8];  // k1 k2 p1 p2 k3 k4 k5 k6, or k1 k2 k3 k4
};

#ifdef __cplusplus
static_assert(sizeof(LensRecord) == 36);

template <class Distortion>
LensRecord lens_record(const Distortion& distortion) {
  LensRecord r{distortion.model, {}};
  bool straight = r.model == lens_brown_conrady;
  for (int i = 0; i < 8; ++i) r.k[i] = float(distortion.k[i]), straight = straight && r.k[i] == 0.0f;
  if (straight) r.model = lens_straight;
  return r;
}
}  // namespace kuafu
#endif
#endif
