// SPDX-License-Identifier: Apache-2.0
// numpy <-> plain C: formats, matrices, stage times.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "bindings/errors.h"

namespace ks_python {

struct Format {
  uint32_t format;
  const char* dtype;
};
inline constexpr Format formats[] = {{KS_FORMAT_U8, "u1"},  {KS_FORMAT_U16, "u2"}, {KS_FORMAT_I16, "i2"},
                                     {KS_FORMAT_U32, "u4"}, {KS_FORMAT_F16, "f2"}, {KS_FORMAT_F32, "f4"}};

inline py::dtype dtype_of(uint32_t format) {
  for (const Format& f : formats)
    if (f.format == format) return py::dtype(f.dtype);
  throw std::logic_error("unknown ks format");
}

template <class Api>
uint32_t format_of(const py::dtype& dtype) {
  for (const Format& f : formats)
    if (dtype.equal(py::dtype(f.dtype))) return f.format;
  raise_argument<Api>("no image can hold " + std::string(py::str(py::handle(dtype))) +
                      " elements (known: uint8, uint16, int16, uint32, float16, float32)");
}

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Copies a matrix of exactly `count` numbers; None leaves `out` as it is.
template <class Api>
void read_matrix(const py::object& value, const char* what, double* out, py::ssize_t count) {
  if (value.is_none()) return;
  const Doubles array = Doubles::ensure(value);
  if (!array) {
    PyErr_Clear();
    raise_argument<Api>(std::string(what) + " is not an array of numbers");
  }
  if (array.size() != count)
    raise_argument<Api>(std::string(what) + " has " + std::to_string(array.size()) + " numbers, it needs " + std::to_string(count));
  std::copy_n(array.data(), count, out);
}

/// A matrix that must be there.
template <class Api>
void read_required_matrix(const py::object& value, const char* what, double* out, py::ssize_t count) {
  if (value.is_none()) raise_argument<Api>(std::string(what) + " is missing: it needs " + std::to_string(count) + " numbers");
  read_matrix<Api>(value, what, out, count);
}

/// value as a T, or an error that names the argument and says what it must be.
template <class Api, class T>
T read_as(const py::handle& value, const char* what, const char* wanted) {
  try {
    if (!value.is_none()) return py::cast<T>(value);
  } catch (const py::cast_error&) {
  }
  raise_argument<Api>(std::string(what) + " must be " + wanted + ", not " + std::string(py::repr(value)));
}

inline py::array_t<double> matrix(const double* values, py::ssize_t rows, py::ssize_t columns) {
  py::array_t<double> out({rows, columns});
  std::copy_n(values, rows * columns, out.mutable_data());
  return out;
}

/// A C call of the form f(handle, times, &count) as {stage: milliseconds}, in the order the stages ran.
template <class Api, class Get>
py::dict stage_times(Get get) {
  uint32_t count = 0;
  check<Api>(get(static_cast<ks_stage_time*>(nullptr), &count));
  std::vector<ks_stage_time> times(count);
  check<Api>(get(times.data(), &count));
  py::dict out;
  for (const ks_stage_time& t : times) out[t.name] = t.milliseconds;
  return out;
}

}  // namespace ks_python
