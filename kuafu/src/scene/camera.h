// SPDX-License-Identifier: Apache-2.0
// The parts of a camera beyond a resting pinhole; fields are those of kuafu_camera_desc and kuafu_optics_desc. Thread rule: plain data.
#pragma once

#include "scene/distortion.h"
#include "scene/fields.h"
#include "scene/motion.h"

namespace kuafu {

struct Lens {
  Distortion distortion{};
  double lens_radius_m = 0.0, focus_m = 0.0;
};

struct Shutter {
  enum class Kind : uint32_t { global = 0, rolling = 1 };
  enum class Readout : uint32_t { rows_down = 0, rows_up = 1, columns_right = 2, columns_left = 3 };
  Kind kind = Kind::global;
  Readout readout = Readout::rows_down;
  double exposure_s = 0.0, line_time_s = 0.0;

  [[nodiscard]] bool takes_time() const { return exposure_s > 0.0 || (kind == Kind::rolling && line_time_s > 0.0); }
  /// The time in which the shutter is open for any pixel of an image.
  [[nodiscard]] TimeSpan span(uint32_t width, uint32_t height) const {
    const bool along_rows = readout == Readout::rows_down || readout == Readout::rows_up;
    const uint32_t lines = along_rows ? height : width;
    const double read_s = kind == Kind::rolling && lines > 1 ? (lines - 1) * line_time_s : 0.0;
    return {-0.5 * (read_s + exposure_s), 0.5 * (read_s + exposure_s)};
  }
};

/// The optics between light and imager; the default changes nothing.
struct Optics : OpticsFields {
  [[nodiscard]] bool defocuses() const { return defocus_lens_radius_m > 0.0; }
};

}  // namespace kuafu
