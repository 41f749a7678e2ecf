// SPDX-License-Identifier: Apache-2.0
// Fields of a C struct as keyword arguments, by name: numbers, flags, choices and sets of bits. The lists of fields are generated
// (capi/generation).
#pragma once

#include <pybind11/stl.h>

#include <algorithm>
#include <string>
#include <variant>
#include <vector>

#include "bindings/errors.h"

namespace ks_python {

template <class Struct>
struct Field {
  enum class Kind { number, flag, choice, bits, id, index };
  const char* name;
  std::variant<float Struct::*, double Struct::*, uint32_t Struct::*, int32_t Struct::*, uint64_t Struct::*> member;
  Kind kind = Kind::number;
  std::vector<const char*> names{};  // of a choice's 0, 1, ..., or of bit 0, 1, ...
  const char* one = nullptr;         // what one of the names is called in a message; the field's name where it is nullptr
};

/// The index of a name among the field's names.
template <class Api, class Struct>
uint32_t index_of(const Field<Struct>& field, const std::string& name) {
  return index_of_name<Api>(field.names, name, field.one ? field.one : field.name);
}

template <class Api>
std::vector<std::string> read_names(const py::handle& names, const std::string& what) {
  const std::string wanted = what + " must be a sequence of names, not " + std::string(py::repr(names));
  if (py::isinstance<py::str>(names) || !py::isinstance<py::iterable>(names)) raise_argument<Api>(wanted);
  std::vector<std::string> out;
  for (const py::handle name : names) {
    if (!py::isinstance<py::str>(name)) raise_argument<Api>(wanted);
    out.push_back(py::cast<std::string>(name));
  }
  return out;
}

/// A sequence of names as bits.
template <class Api, class Struct>
uint32_t bits_of(const Field<Struct>& field, const py::handle& names) {
  uint32_t bits = 0;
  for (const std::string& name : read_names<Api>(names, field.name)) bits |= 1u << index_of<Api>(field, name);
  return bits;
}

/// The number that Python's value stands for in C.
template <class Api, class Struct>
py::object number_of(const Field<Struct>& field, const py::handle& value) {
  using Kind = typename Field<Struct>::Kind;
  if (field.kind == Kind::bits) return py::int_(bits_of<Api>(field, value));
  if (field.kind == Kind::choice && py::isinstance<py::str>(value)) return py::int_(index_of<Api>(field, py::cast<std::string>(value)));
  if (field.kind == Kind::flag) return py::int_(py::cast<bool>(value) ? 1 : 0);
  if (field.kind == Kind::id) return value.is_none() ? py::int_(0) : py::int_(py::cast<uint32_t>(value) + 1);
  if (field.kind == Kind::index && value.is_none()) return py::int_(0xffffffffu);
  return py::reinterpret_borrow<py::object>(value);
}

/// Whether there is such a field; it is set then.
template <class Api, class Struct, size_t count>
bool set_field(Struct& record, const Field<Struct> (&fields)[count], const std::string& name, const py::handle& value) {
  const auto field = std::find_if(std::begin(fields), std::end(fields), [&](const Field<Struct>& f) { return name == f.name; });
  if (field == std::end(fields)) return false;
  try {
    const py::object number = number_of<Api>(*field, value);
    std::visit([&](auto member) { record.*member = py::cast<std::decay_t<decltype(record.*member)>>(number); }, field->member);
  } catch (const py::cast_error&) {
    raise_argument<Api>(name + " cannot be " + std::string(py::repr(value)));
  }
  return true;
}

template <class Struct, size_t count>
void get_fields(const Struct& record, const Field<Struct> (&fields)[count], py::dict& out) {
  for (const Field<Struct>& field : fields) std::visit([&](auto member) { out[field.name] = record.*member; }, field.member);
}

/// The names of a field's choices or bits.
template <class Struct, size_t count>
py::tuple names_of(const Field<Struct> (&fields)[count], const std::string& name) {
  py::list names;
  for (const Field<Struct>& field : fields)
    if (name == field.name)
      for (const char* known : field.names) names.append(known);
  return py::tuple(names);
}

}  // namespace ks_python
