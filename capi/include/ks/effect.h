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

/* The stage of the pipeline at which an effect acts, which decides what its images are; each is [height][width].
 * Up to KS_STAGE_CAMERA there are four images of radiance: the projector's direct light, its indirect light, ambient light, and the direct
 * light with a pattern of 1 everywhere. Optics: any number of images of radiance, which are all changed in the same linear way. Charge and
 * readout: one image, in DN above the black level. Digital: one image, in DN. Disparity: one image in pixels of the left image, 0 for no
 * match. Depth: one image in metres, seen from the left camera, 0 for no measurement. */
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

/* An effect is not random; random but fixed for one sensor, equal in repeated frames; or random and new in every frame. */
#define KS_RANDOMNESS_NONE 0u
#define KS_RANDOMNESS_STATIC 1u
#define KS_RANDOMNESS_TEMPORAL 2u

/* What the lab looks for to find a random effect: parameter x lever x a random number of standard deviation 1. It is a fixed field
 * (KS_RANDOMNESS_STATIC) or a term of the law of the noise (KS_RANDOMNESS_TEMPORAL). An effect that is not random needs no such term. */
#define KS_LEVER_ONE 0u       /* 1 DN */
#define KS_LEVER_SIGNAL 1u    /* DN above black */
#define KS_LEVER_PROJECTOR 2u /* DN of the projector's direct light */
#define KS_LEVER_EXPOSURE 3u  /* exposure x gain, seconds */
#define KS_LEVER_PHOTONS 4u   /* square root of gain x DN above black; the parameter is the variance's factor */
/* What has one random number: a pixel of one eye; a pixel for as long as the rig stands still; a column or a row of one eye; a dot. */
#define KS_SHARED_BY_PIXEL 0u
#define KS_SHARED_BY_VIEW 1u
#define KS_SHARED_BY_COLUMN 2u
#define KS_SHARED_BY_ROW 3u
#define KS_SHARED_BY_DOT 4u

typedef struct ks_effect_random_term {
  const char* parameter;    /* the parameter that scales the random numbers */
  const char* sparse_share; /* the parameter that is the share of places with such a number; NULL: all */
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

/* low <= neutral <= high, low < high. neutral: the value without any effect; typical: one standard deviation of the prior, positive. */
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
