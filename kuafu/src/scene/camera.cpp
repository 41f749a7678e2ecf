#include "scene/camera.h"

namespace kuafu {

TimeSpan Shutter::span(uint32_t width, uint32_t height) const {
  const bool along_rows = readout == Readout::rows_down || readout == Readout::rows_up;
  const uint32_t lines = along_rows ? height : width;
  const double read_s = kind == Kind::rolling && lines > 1 ? (lines - 1) * line_time_s : 0.0;
  return {-0.5 * (read_s + exposure_s), 0.5 * (read_s + exposure_s)};
}

}  // namespace kuafu
