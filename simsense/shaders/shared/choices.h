// SPDX-License-Identifier: Apache-2.0
// Choices, reasons and flags by number, read by GLSL and C++. C++ turns them into enumerations and holds them against the public header
// (match/choices.h).
#ifndef SIMSENSE_CHOICES_H
#define SIMSENSE_CHOICES_H

#define CENSUS_CENTER_SYMMETRIC 0u
#define CENSUS_PLAIN 1u

#define SUBPIXEL_NONE 0u
#define SUBPIXEL_PARABOLA 1u
#define SUBPIXEL_EQUIANGULAR 2u
#define SUBPIXEL_EQUIANGULAR_SUMMED 3u
#define SUBPIXEL_LUCAS_KANADE 4u

#define HOLES_KEEP 0u
#define HOLES_LEFT 1u
#define HOLES_BACKGROUND 2u

#define REASON_VALID 0u
#define REASON_NOT_UNIQUE 1u
#define REASON_OUTSIDE 2u
#define REASON_OCCLUDED 3u
#define REASON_ISOLATED 4u
#define REASON_SPECKLE 5u
#define REASON_OUT_OF_RANGE 6u
#define REASON_NOT_COMPUTED 7u
#define REASON_LOW_TEXTURE 8u
#define REASON_SATURATED 9u

// Which maps are wanted beside the disparities.
#define MAPS_CONFIDENCE 1u
#define MAPS_REASON 2u

// Which paths one dispatch follows.
#define PATHS_ROWS_AND_COLUMNS 0u
#define PATHS_DIAGONALS 1u
#define PATHS_ROWS 2u
#define PATHS_COLUMNS 3u

#endif
