/* A physical effect as plain data: what a plug-in brings to the lab in C, field by field what python/activestereo/effects has in Python.
 *
 * A plug-in is a shared library that exports one function of type ks_effect_plugin_fn named KS_EFFECT_PLUGIN_NAME. All that it points to
 * stays valid and unchanged while the library is loaded. The lab checks five laws before it trusts an effect: neutral parameters are the
 * identity; the same input gives the same bits; finite values in range; every parameter has an influence; the input is left alone
 * (`activestereo effect check plugin.so`). */
#ifndef KS_EFFECT_H
#define KS_EFFECT_H

#include <stdint.h>

#include "ks/header.h"
#include "ks/status.h"

/* Where on the light's way an effect acts, and what its images are, each [height][width].
 * To KS_STAGE_CAMERA: four, of radiance: the projector's direct light, its bounced light, ambient light, and `direct` under a pattern of 1
 * everywhere. Optics: any number, of radiance, all to be treated alike and linearly. From charge to readout: one, DN above black. Digital:
 * one, DN. Disparity: one, pixels, left image, 0 = no match. Depth: one, metres, left image, 0 = none. */
#define KS_STAGE_PROJECTOR 1u
#define KS_STAGE_MEDIUM 2u
#define KS_STAGE_SURFACE 3u
#define KS_STAGE_CAMERA 4u
#define KS_STAGE_OPTICS 5u
#define KS_STAGE_CHARGE 6u
#define KS_STAGE_READOUT 7u
#define KS_STAGE_DIGITAL 8u
#define KS_STAGE_DISPARITY 9u
#define KS_STAGE_DEPTH 10u

/* Drawn never; once per sensor, the same in repeats; anew in every frame. */
#define KS_RANDOMNESS_NONE 0u
#define KS_RANDOMNESS_STATIC 1u
#define KS_RANDOMNESS_TEMPORAL 2u

/* How the lab finds a random effect: parameter x lever x a draw of deviation 1, a field that stays (KS_RANDOMNESS_STATIC) or a term of the
 * noise law (KS_RANDOMNESS_TEMPORAL). An effect that is drawn never needs none: its expected image tells it. */
#define KS_LEVER_ONE 0u       /* 1 DN */
#define KS_LEVER_SIGNAL 1u    /* DN above black */
#define KS_LEVER_PROJECTOR 2u /* DN of the projector's direct light */
#define KS_LEVER_EXPOSURE 3u  /* exposure x gain, seconds */
#define KS_LEVER_PHOTONS 4u   /* square root of gain x DN above black; the parameter is the variance's factor */
/* What shares one draw: a pixel of one eye; the same while the rig stands still; a column, a row of one eye; a dot of the pattern. */
#define KS_SHARED_BY_PIXEL 0u
#define KS_SHARED_BY_VIEW 1u
#define KS_SHARED_BY_COLUMN 2u
#define KS_SHARED_BY_ROW 3u
#define KS_SHARED_BY_DOT 4u

typedef struct ks_effect_random_term {
  const char* parameter;    /* that scales the draws */
  const char* sparse_share; /* the parameter that says which share of the places has a draw; NULL = all have */
  uint32_t lever;           /* KS_LEVER_* */
  uint32_t shared_by;       /* KS_SHARED_BY_* */
} ks_effect_random_term;

/* Chained to a random effect's header.next; an effect without it is listed as not ranked. */
typedef struct ks_effect_random_terms {
  ks_header header;
  const ks_effect_random_term* terms;
  uint32_t count;
  uint32_t reserved; /* 0 */
} ks_effect_random_terms;

static inline ks_effect_random_terms ks_effect_random_terms_init(void) {
  ks_effect_random_terms t = {0};
  t.header = ks_header_make(KS_TYPE_EFFECT_RANDOM_TERMS, (uint32_t)sizeof t);
  return t;
}

/* low <= neutral <= high, low < high. neutral: the value of no effect; typical: one prior deviation from neutral, positive. */
typedef struct ks_effect_parameter {
  const char* name;   /* an identifier */
  const char* unit;   /* "1" where there is none */
  const char* source; /* may be "" */
  double neutral;
  double low;
  double high;
  double typical;
} ks_effect_parameter;

/* What an effect may know of one image. Matrices are row-major; a_to_b maps coordinates in a to those in b. Camera: x right, y down, z
 * forward, pixel centres at integers. */
typedef struct ks_effect_view {
  ks_header header;
  uint32_t width;
  uint32_t height;
  uint32_t is_right; /* 0 = left eye */
  uint32_t frame_id;
  double k[9];
  double projector_k[9];
  double camera_to_projector[16];
  double left_to_camera[16];
  double camera_velocity[6]; /* left camera's twist in its own frame, m/s and rad/s */
  double baseline_m;
  double max_dn;
  double exposure_s;
  double gain;
  double timestamp_s;
  double temperature_c;  /* NAN = not known */
  uint64_t random_seed;  /* differs between eyes; between frames too for KS_RANDOMNESS_TEMPORAL, and only then */
  const double* depth_m; /* [height][width], 0 = nothing there */
  const double* normal;  /* [height][width][3], unit, camera coordinates */
  const float* pattern;  /* [pattern_height][pattern_width], 0..1 */
  uint32_t pattern_width;
  uint32_t pattern_height;
} ks_effect_view;

/* Reads images[image_count][height][width] and writes as many to `out`, which does not overlap them. `parameters` are in the descriptor's
 * order and in range. Called from one thread at a time. Returns a ks_status; anything but KS_OK is an error. */
typedef int32_t (*ks_effect_apply_fn)(const ks_effect_view* view, const double* parameters, uint32_t image_count, const double* images,
                                      double* out);

typedef struct ks_effect {
  ks_header header;
  const char* id;      /* an identifier, unique */
  const char* family;  /* effects that are hard to tell apart share one */
  const char* summary; /* one sentence: what is seen */
  const char* source;  /* paper, datasheet, own measurement */
  uint32_t stage;      /* KS_STAGE_* */
  uint32_t randomness; /* KS_RANDOMNESS_* */
  uint32_t parameter_count;
  uint32_t reserved; /* 0 */
  const ks_effect_parameter* parameters;
  ks_effect_apply_fn apply;
} ks_effect;

static inline ks_effect ks_effect_init(void) {
  ks_effect e = {0};
  e.header = ks_header_make(KS_TYPE_EFFECT, (uint32_t)sizeof e);
  return e;
}

#define KS_EFFECT_PLUGIN_NAME "ks_effect_plugin"
/* Returns an array of effects and writes its length. */
typedef const ks_effect* (*ks_effect_plugin_fn)(uint32_t* count);

#endif
