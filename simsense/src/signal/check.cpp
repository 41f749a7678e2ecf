// SPDX-License-Identifier: Apache-2.0
#include "device/error.h"
#include "parameters/fields.h"
#include "signal/imager.h"

namespace simsense {
void check_signal(const simsense_signal& s, const char* side) {
  check_fields(s, std::string(side) + " signal: ");
  if (s.speckle_shape > 0 && !(s.speckle_scale > 0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: speckle_scale is %g with speckle_shape %g: must be > 0 (1 / shape keeps the mean)",
             side, s.speckle_scale, s.speckle_shape);
  if (s.speckle_psf_sigma_px > 0 && s.speckle_psf_sigma_px < 0.1f)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: speckle_psf_sigma_px is %g: must be 0 (white) or 0.1..16", side,
             s.speckle_psf_sigma_px);
  if (s.extra_bits > 0 && s.bit_depth != 8)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: extra_bits is %u with a bit_depth of %u: must be 0, or bit_depth 8", side, s.extra_bits,
             s.bit_depth);
  if (s.blooming > 0 && !(s.full_well_e > 0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: blooming is %g with full_well_e %g: an unbounded well cannot overflow", side,
             s.blooming, s.full_well_e);
  const float doublings = (s.temperature_c - s.dark_reference_c) / s.dark_doubling_k;
  if (doublings > 40)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: dark current doubles %g times from dark_reference_c %g to temperature_c %g: at most 40",
             side, doublings, s.dark_reference_c, s.temperature_c);
}

}  // namespace simsense
