// simsense_parameters and simsense_signal by field name.
#pragma once

#include "fields.h"

namespace ks_python {

/// The number of a choice that is given by name; any other value as it is.
template <class Struct>
py::object chosen(const Field<Struct>& field, const py::handle& value) {
  if (field.choices.empty() || !py::isinstance<py::str>(value)) return py::reinterpret_borrow<py::object>(value);
  const auto name = py::cast<std::string>(value);
  std::string known;
  for (size_t i = 0; i < field.choices.size(); ++i) {
    if (name == field.choices[i]) return py::int_(i);
    known += (known.empty() ? "" : ", ") + std::string(field.choices[i]);
  }
  raise_argument<Simsense>(std::string(field.name) + " is '" + name + "' (known: " + known + ")");
}

/// Whether there is such a field; it is set then.
template <class Struct, size_t count>
bool set_field(Struct& record, const Field<Struct> (&fields)[count], const std::string& name, const py::handle& value) {
  const auto field = std::find_if(std::begin(fields), std::end(fields), [&](const Field<Struct>& f) { return name == f.name; });
  if (field == std::end(fields)) return false;
  try {
    const py::object number = chosen(*field, value);
    std::visit([&](auto member) { record.*member = py::cast<std::decay_t<decltype(record.*member)>>(number); }, field->member);
  } catch (const py::cast_error&) {
    raise_argument<Simsense>(name + " cannot be " + std::string(py::repr(value)));
  }
  return true;
}

template <class Struct, size_t count>
void get_fields(const Struct& record, const Field<Struct> (&fields)[count], py::dict& out) {
  for (const Field<Struct>& field : fields) std::visit([&](auto member) { out[field.name] = record.*member; }, field.member);
}

inline void set_signal(simsense_signal& signal, const py::object& changes, const char* eye) {
  if (!py::isinstance<py::dict>(changes))
    raise_argument<Simsense>(std::string(eye) + " must be a dict of parameters, not " + std::string(py::repr(changes)));
  for (const auto& [key, value] : py::reinterpret_borrow<py::dict>(changes)) {
    const std::string name = py::str(key);
    if (!set_field(signal, signal_fields, name, value))
      throw py::type_error("an imager has no parameter '" + name + "'; see simsense_signal");
  }
}

inline py::dict get_signal(const simsense_signal& signal) {
  py::dict out;
  get_fields(signal, signal_fields, out);
  return out;
}

inline simsense_signal signal_preset(const std::string& name) {
  simsense_signal signal = simsense_signal_init();
  check<Simsense>(simsense_signal_preset(name.c_str(), &signal));
  return signal;
}

/// All that an engine can be told between frames.
struct Settings {
  simsense_parameters parameters = simsense_parameters_init();
  simsense_signal left = simsense_signal_init(), right = simsense_signal_init();

  /// A signal's name means both eyes.
  void change(const py::kwargs& changes) {
    for (const auto& [key, value] : changes) {
      const std::string name = py::str(key);
      if (set_field(parameters, parameter_fields, name, value)) continue;
      if (!set_field(left, signal_fields, name, value))
        throw py::type_error("simsense has no parameter '" + name + "'; see help(simsense.Engine)");
      set_field(right, signal_fields, name, value);
    }
  }
};

}  // namespace ks_python
