// SPDX-License-Identifier: Apache-2.0
// Fields of a C struct as properties of the Python class that holds it in its member `c`.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "bindings/lens.h"
#include "records.h"

namespace ks_python {

template <class Record, class Desc, class T>
void scalar(py::class_<Record>& type, const char* name, T Desc::*member, const char* doc = "") {
  type.def_property(
      name, [member](const Record& r) { return r.c.*member; }, [member](Record& r, T value) { r.c.*member = value; }, doc);
}

/// A field that Python reads alone.
template <class Desc, class T>
void answer(py::class_<Desc>& type, const char* name, T Desc::*member, const char* doc) {
  if constexpr (std::is_array_v<T>)
    type.def_property_readonly(
        name, [member](const Desc& d) { return py::tuple(py::cast(std::to_array(d.*member))); }, doc);
  else
    type.def_readonly(name, member, doc);
}

template <class Record, class Desc, class T, size_t n>
void vector(py::class_<Record>& type, const char* name, T (Desc::*member)[n], const char* doc = "") {
  type.def_property(
      name,
      [member](const Record& r) {
        std::array<T, n> out;
        std::copy_n(r.c.*member, n, out.begin());
        return py::tuple(py::cast(out));
      },
      [member](Record& r, const std::array<T, n>& value) { std::copy(value.begin(), value.end(), r.c.*member); }, doc);
}

template <class Record, class Desc, size_t n>
void square(py::class_<Record>& type, const char* name, double (Desc::*member)[n], const char* doc) {
  constexpr py::ssize_t side = n == 16 ? 4 : 3;
  type.def_property(
      name, [member](const Record& r) { return matrix(r.c.*member, side, side); },
      [member, name](Record& r, const py::object& value) { read_matrix<Kuafu>(value, name, r.c.*member, n); }, doc);
}

/// NaN in C, None in Python.
template <class Record, class Desc>
void maybe(py::class_<Record>& type, const char* name, float Desc::*member, const char* doc) {
  type.def_property(
      name, [member](const Record& r) { return std::isnan(r.c.*member) ? std::optional<float>() : r.c.*member; },
      [member](Record& r, std::optional<float> value) { r.c.*member = value.value_or(NAN); }, doc);
}

/// KUAFU_ALL_ENVIRONMENTS in C, None in Python.
template <class Record, class Desc>
void maybe(py::class_<Record>& type, const char* name, uint32_t Desc::*member, const char* doc) {
  type.def_property(
      name, [member](const Record& r) { return r.c.*member == KUAFU_ALL_ENVIRONMENTS ? std::optional<uint32_t>() : r.c.*member; },
      [member](Record& r, std::optional<uint32_t> value) { r.c.*member = value.value_or(KUAFU_ALL_ENVIRONMENTS); }, doc);
}

/// An id, which counts from 1 and is 0 for none in C; a number from 0, or None, in Python.
template <class Record, class Desc>
void id(py::class_<Record>& type, const char* name, uint32_t Desc::*member, const char* doc) {
  type.def_property(
      name, [member](const Record& r) { return r.c.*member == 0 ? std::optional<uint32_t>() : r.c.*member - 1; },
      [member](Record& r, std::optional<uint32_t> value) { r.c.*member = value ? *value + 1 : 0; }, doc);
}

/// 0 and 1 in C, a bool in Python.
template <class Record, class Desc>
void flag(py::class_<Record>& type, const char* name, uint32_t Desc::*member, const char* doc) {
  type.def_property(
      name, [member](const Record& r) { return r.c.*member != 0; }, [member](Record& r, bool value) { r.c.*member = value ? 1 : 0; }, doc);
}

/// A C constant that counts from `first`, by its name in Python.
template <class Record, class Desc, size_t n>
void named(py::class_<Record>& type, const char* name, uint32_t Desc::*member, const std::array<std::string_view, n>& names, uint32_t first,
           const char* doc) {
  type.def_property(
      name, [member, names, first](const Record& r) { return names.at(r.c.*member - first); },
      [member, names, first, name](Record& r, const std::string& value) { r.c.*member = index_of_name<Kuafu>(names, value, name) + first; },
      doc);
}

/// A lens as two properties: its model, and its coefficients, 4, 5 or all 8 of them.
template <class Record, class Desc>
void lens(py::class_<Record>& type, ks_lens Desc::*member, const char* doc) {
  type.def_property(
      "lens_model", [member](const Record& r) { return lens_models.at((r.c.*member).model); },
      [member](Record& r, const std::string& name) { (r.c.*member).model = read_lens_model<Kuafu>(name); }, doc);
  type.def_property(
      "distortion", [member](const Record& r) { return py::tuple(py::cast(std::to_array((r.c.*member).distortion))); },
      [member](Record& r, const std::vector<double>& values) { read_distortion<Kuafu>(values, r.c.*member); },
      "Its coefficients: 4, 5 or 8 of Brown and Conrady's, 4 of a fisheye lens.");
}

}  // namespace ks_python
