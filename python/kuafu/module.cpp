// SPDX-License-Identifier: Apache-2.0
// The Python module kuafu._kuafu: a translation of kuafu.h, nothing more.
#include "kuafu_api.h"

PYBIND11_MODULE(_kuafu, module) {
  using namespace ks_python;
  module.doc() = "Path tracer for active stereo: infrared pattern projectors, point lights, light groups and AOVs.";
  const uint32_t v = kuafu_version();
  module.attr("__version__") = std::to_string(v / 10000) + "." + std::to_string(v / 100 % 100) + "." + std::to_string(v % 100);
  Errors<Kuafu>::define(module);
  bind_device<Kuafu>(module);
  bind_buffer<Kuafu>(module);
  bind_records(module);
  bind_scene(module);
  bind_renderer(module);
}
