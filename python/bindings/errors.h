// SPDX-License-Identifier: Apache-2.0
// A failed status becomes a Python exception that is also the built-in a caller would expect (ValueError, OSError, FileNotFoundError).
// Thread rule: the GIL is held, on the thread of the failed call (the message is thread-local).
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "bindings/gil.h"

namespace ks_python {

/// The module's exception types; they live as long as the interpreter.
template <class Api>
struct Errors {
  static inline PyObject* error = nullptr;
  static inline PyObject* argument = nullptr;
  static inline PyObject* file = nullptr;
  static inline PyObject* not_found = nullptr;
  static inline PyObject* no_device = nullptr;
  static inline PyObject* cancelled = nullptr;

  static void define(py::module_& module) {
    error = add(module, "Error", "A call failed. `status` is the library's status code.", py::make_tuple(py::handle(PyExc_RuntimeError)));
    argument = add(module, "ArgumentError", "An argument is wrong.", bases(PyExc_ValueError));
    file = add(module, "FileError", "A file cannot be read or understood.", bases(PyExc_OSError));
    not_found =
        add(module, "MissingFileError", "A file does not exist.", py::make_tuple(py::handle(file), py::handle(PyExc_FileNotFoundError)));
    no_device =
        add(module, "NoDeviceError", "No usable device; the message says why and what to install.", py::make_tuple(py::handle(error)));
    cancelled = add(module, "CancelledError", "A progress callback asked to stop.", py::make_tuple(py::handle(error)));
  }

 private:
  static py::tuple bases(PyObject* builtin) { return py::make_tuple(py::handle(error), py::handle(builtin)); }
  static PyObject* add(py::module_& module, const char* name, const char* doc, const py::tuple& parents) {
    const std::string full = std::string(Api::name) + "." + name;
    PyObject* type = PyErr_NewExceptionWithDoc(full.c_str(), doc, parents.ptr(), nullptr);
    if (!type) throw py::error_already_set();
    module.attr(name) = py::handle(type);
    return type;
  }
};

/// A message of the library. It may quote a broken file, whose bytes need not be UTF-8.
inline py::object decoded(std::string_view text) {
  return py::reinterpret_steal<py::object>(PyUnicode_DecodeUTF8(text.data(), py::ssize_t(text.size()), "backslashreplace"));
}

template <class Api>
[[noreturn]] void raise(ks_status status, PyObject* type, const std::string& text) {
  py::object exception = py::reinterpret_borrow<py::object>(type)(decoded(text));
  exception.attr("status") = status;
  PyErr_SetObject(type, exception.ptr());
  throw py::error_already_set();
}

template <class Api>
[[noreturn]] void raise_argument(const std::string& text) {
  raise<Api>(KS_ERROR_INVALID_ARGUMENT, Errors<Api>::argument, text);
}

/// The index of the entry with this name, or an error that lists all names. what: what the error calls a name.
template <class Api, class Entries, class NameOf = std::identity>
uint32_t index_of_name(const Entries& entries, std::string_view wanted, const std::string& what, const NameOf& name_of = {}) {
  uint32_t index = 0;
  std::string known;
  for (const auto& entry : entries) {
    const std::string_view name = std::invoke(name_of, entry);
    if (name == wanted) return index;
    known.append(index++ > 0 ? ", " : "").append(name);
  }
  raise_argument<Api>("unknown " + what + " '" + std::string(wanted) + "' (known: " + known + ")");
}

template <class Api>
void check(ks_status status, const std::string& message) {
  if (status >= 0) return;
  PyObject* type = Errors<Api>::error;
  if (status == KS_ERROR_INVALID_ARGUMENT) type = Errors<Api>::argument;
  if (status == KS_ERROR_FILE) type = Errors<Api>::file;
  if (status == KS_ERROR_NO_DEVICE) type = Errors<Api>::no_device;
  if (status == KS_ERROR_CANCELLED) type = Errors<Api>::cancelled;
  raise<Api>(status, type, message);
}

template <class Api>
void check(ks_status status) {
  if (status < 0) check<Api>(status, Api::last_error());
}

/// check() of a call that may wait for the device: other Python threads run meanwhile, so that one of them inside the library can give its
/// lock back though it needs the GIL first (a log callback).
template <class Api, class Call>
void check_unlocked(const Call& call) {
  check<Api>(unlocked(call));
}

template <class Api>
void check_file(ks_status status, const std::string& message, const std::filesystem::path& path) {
  std::error_code ignored;
  if (status == KS_ERROR_FILE && !std::filesystem::exists(path, ignored)) raise<Api>(status, Errors<Api>::not_found, message);
  check<Api>(status, message);
}

}  // namespace ks_python
