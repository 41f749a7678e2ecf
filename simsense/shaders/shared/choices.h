// SPDX-License-Identifier: Apache-2.0
// Choices, reasons and flags by number, read by GLSL and C++, which makes enumerations of the public ones (match/matcher.h).
#ifndef SIMSENSE_CHOICES_H
#define SIMSENSE_CHOICES_H

#include "shared/public_choices.h"  // by capi/generation

// Whether low texture or saturation of the left image may explain a pixel better than its reason does.
#define MAY_BE_EXPLAINED(reason) ((reason) != REASON_VALID && (reason) != REASON_OUTSIDE && (reason) != REASON_NOT_COMPUTED)

// Which maps are wanted beside the disparities.
#define MAPS_CONFIDENCE 1u
#define MAPS_REASON 2u

// Which paths one dispatch follows.
#define PATHS_ROWS_AND_COLUMNS 0u
#define PATHS_DIAGONALS 1u
#define PATHS_ROWS 2u
#define PATHS_COLUMNS 3u

#endif
