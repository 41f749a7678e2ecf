// SPDX-License-Identifier: Apache-2.0
// The uses of randomness by number, read by GLSL and C++ (signal/key.h): each has a number of its own.
#ifndef SIMSENSE_DIMENSIONS_H
#define SIMSENSE_DIMENSIONS_H

#define DIMENSION_SPECKLE_STATIC 0u  // the temporal one follows
#define DIMENSION_SPECKLE_TEMPORAL 1u
#define DIMENSION_PRNU 2u
#define DIMENSION_HOT_PIXEL 3u
#define DIMENSION_SHOT 4u
#define DIMENSION_DSNU 5u
#define DIMENSION_ROW_FIXED 6u
#define DIMENSION_COLUMN_FIXED 7u
#define DIMENSION_ROW_TEMPORAL 8u
#define DIMENSION_COLUMN_TEMPORAL 9u
#define DIMENSION_READ 10u
#define DIMENSION_ADC 11u

#endif
