// SPDX-License-Identifier: Apache-2.0
// simsense_parameters and simsense_signal by field name.
#pragma once

#include "fields.h"

namespace ks_python {

inline void set_signal(simsense_signal& signal, const py::object& changes, const char* side) {
  if (!py::isinstance<py::dict>(changes))
    raise_argument<Simsense>(std::string(side) + " must be a dict of parameters, not " + std::string(py::repr(changes)));
  for (const auto& [key, value] : py::reinterpret_borrow<py::dict>(changes)) {
    const std::string name = py::str(key);
    if (!set_field<Simsense>(signal, signal_fields, name, value))
      throw py::type_error("an imager has no parameter '" + name + "'; see simsense_signal");
  }
}

inline py::dict get_signal(const simsense_signal& signal) {
  py::dict out;
  get_fields(signal, signal_fields, out);
  return out;
}

/// All settings of an engine that may change between frames.
struct Settings {
  simsense_parameters parameters = simsense_parameters_init();
  simsense_signal left = simsense_signal_init(), right = simsense_signal_init();

  /// A signal's name means both cameras.
  void change(const std::string& name, const py::handle& value) {
    if (set_field<Simsense>(parameters, parameter_fields, name, value)) return;
    if (!set_field<Simsense>(left, signal_fields, name, value))
      throw py::type_error("simsense has no parameter '" + name + "'; see help(simsense.Engine)");
    set_field<Simsense>(right, signal_fields, name, value);
  }
};

}  // namespace ks_python
