/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KS_LENS_H
#define KS_LENS_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KS_LENS_BROWN_CONRADY 0u
#define KS_LENS_KANNALA_BRANDT 1u
typedef struct ks_lens {
  uint32_t model;
  uint32_t reserved;
  double distortion[8];
} ks_lens;
#ifdef __cplusplus
}
#endif
#endif
