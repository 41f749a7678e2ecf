// SPDX-License-Identifier: Apache-2.0
// The yardstick for CPU devices: a plain program that traces the table-top's rays with Embree in packets of eight and shades them in place,
// in one loop per packet; no queues, no Vulkan. GGX over Lambert, the projector's light, path depth 3: as many rays as the library traces.
#pragma once

#include <memory>

#include "table_top.h"

namespace bench {

class PlainTracer {
 public:
  explicit PlainTracer(const TableTop& scene);
  ~PlainTracer();
  struct Result {
    std::vector<float> image;  // [view][height][width]
    double rays = 0;
  };
  /// Infrared radiance by `threads` threads.
  Result render(const std::vector<kuafu_camera_desc>& cameras, uint32_t samples, uint32_t depth, uint32_t threads) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace bench
