// SPDX-License-Identifier: Apache-2.0
// Included (not once) by each file that is compiled for every instruction set; HWY_TARGET_INCLUDE names that file.
// AVX3_DL brings the byte popcount; SSSE3 alone is not worth its code (every such CPU falls back to the portable target).
// SVE's vectors have no size at compile time and fit into no array; every such CPU has NEON.
#ifndef HWY_WANT_AVX3_DL
#define HWY_WANT_AVX3_DL
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#endif
#include "hwy/foreach_target.h"
