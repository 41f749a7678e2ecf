// SPDX-License-Identifier: Apache-2.0
// The Python module simsense._simsense: a translation of simsense.h, nothing more.
#include "simsense_api.h"

PYBIND11_MODULE(_simsense, module) {
  using namespace ks_python;
  module.doc() = "Stereo depth engine: imager noise, rectification, census, semi-global matching, checks, registration.";
  const uint32_t v = simsense_version();
  module.attr("__version__") = std::to_string(v / 10000) + "." + std::to_string(v / 100 % 100) + "." + std::to_string(v % 100);
  Errors<Simsense>::define(module);
  bind_device<Simsense>(module);
  bind_buffer<Simsense>(module);
  bind_engine(module);
}
