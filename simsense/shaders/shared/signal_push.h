// SPDX-License-Identifier: Apache-2.0
// What the signal stages of one camera share, read by GLSL and C++ (scalar layout): the block of an imager's parameters, and the push
// constants.
#ifndef SIMSENSE_SIGNAL_PUSH_H
#define SIMSENSE_SIGNAL_PUSH_H
#include "shared/image_ref.h"

#ifdef __cplusplus
namespace simsense {
using SignalBlockAddress = uint64_t;
using SignalFloats = uint64_t;
struct SignalKey {
  uint x, y;
};
inline constexpr uint signal_pairs = 1024, grain_taps = 129, gamma_intervals = 1025;
#else
#define SignalKey uvec2
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer SignalFloats { float at[]; };
const uint signal_pairs = 1024u;  // images of one dispatch
const uint grain_taps = 129u;     // of the widest PSF
const uint gamma_intervals = 1025u;
#endif

/// The stages' parameters with constant products taken, as in simsense_signal; neutral values switch a stage off.
struct SignalParameters {
  SignalFloats charge;      // [pairs][height][pitch] e-, where wells bloom
  SignalFloats normals[2];  // [pairs][height][pitch] of the static and of the temporal speckle, where grains are correlated
  SignalFloats along_rows;  // [pairs][height + 2 * grain_radius][pitch], of one part after the other
  uint width, height, pitch;
  uint speckle_parts;  // bit 0 static, bit 1 temporal
  uint grain_radius;   // 0 = white
  float electrons_per_unit, prnu, dark_e, hot_share, hot_mean_e, shot_noise;
  float full_well_e, bloom_share;
  float dsnu_e, row_fixed_e, column_fixed_e, row_noise_e, column_noise_e, read_noise_e;
  float dn_per_e, response_exponent, max_dn, adc_noise_dn, black_dn;
  ImageRef laser;  // the light that has speckle; absent: all has
};

/// Keys of one image's streams.
struct SignalKeys {
  SignalKey frame, scene, sensor;
};

struct SignalHead {
  SignalParameters parameters;
  SignalKeys keys[signal_pairs];
};

/// Start and slope of a table's interval (signal/gamma_quantile.h).
struct GammaInterval {
  float start, slope;
};

struct SignalTables {
  float grain_weights[grain_taps];
  GammaInterval gamma[2 * gamma_intervals];  // static, temporal
};

#ifndef __cplusplus
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer SignalBlockAddress {
  SignalHead head;
  SignalTables tables;
};
#endif

#define SIGNAL_COLLECT 1u   // light to charge
#define SIGNAL_READ_OUT 2u  // charge to counts; both in one pass where wells do not bloom

struct SignalPush {
  SignalBlockAddress block;
  ImageRef light, counts, ir;  // counts: for the stages that follow; ir: for the caller, may be absent
  uint passes;                 // SIGNAL_*; of the grain stage: the part of the speckle
  uint columns;                // of the grain stage: nonzero for its second pass
};

#ifdef __cplusplus
struct SignalBlock {
  SignalHead head;
  SignalTables tables;
};
static_assert(sizeof(SignalPush) == 112);
static_assert(sizeof(SignalParameters) == 32 + 24 * 4 + sizeof(ImageRef));
static_assert(sizeof(SignalHead) % 4 == 0 && sizeof(SignalTables) % 4 == 0);
}  // namespace simsense
#endif
#endif
