// SPDX-License-Identifier: Apache-2.0
// Arrays as DLPack hands them from one library to another, without a copy: the legacy tensor ("dltensor") and the versioned one of DLPack 1
// ("dltensor_versioned"). The structs are those of the protocol's C interface (dmlc.github.io/dlpack). Host memory alone: memory of a GPU
// is shared by its file descriptor (Buffer.export). Thread rule: the GIL is held.
#pragma once

#include <memory>
#include <vector>

#include "bindings/convert.h"

namespace ks_python::dlpack {

struct Device {
  int32_t type, id;
};
inline constexpr int32_t device_cpu = 1, device_cuda_host = 3, device_cuda_managed = 13;

struct DataType {
  uint8_t code, bits;
  uint16_t lanes;
};

struct Tensor {
  void* data;
  Device device;
  int32_t ndim;
  DataType dtype;
  int64_t* shape;
  int64_t* strides;  // in elements; NULL = packed
  uint64_t byte_offset;
};

/// Legacy.
struct Managed {
  Tensor tensor;
  void* context;
  void (*deleter)(Managed*);
  static constexpr const char *name = "dltensor", *used_name = "used_dltensor";
};

struct ManagedVersioned {
  uint32_t major, minor;
  void* context;
  void (*deleter)(ManagedVersioned*);
  uint64_t flags;
  Tensor tensor;
  static constexpr const char *name = "dltensor_versioned", *used_name = "used_dltensor_versioned";
};
inline constexpr uint32_t version_major = 1, version_minor = 0;
inline constexpr uint64_t flag_read_only = 1;

struct Element {
  uint32_t format;
  DataType dtype;
};
inline constexpr Element elements[] = {{KS_FORMAT_U8, {1, 8, 1}},   {KS_FORMAT_U16, {1, 16, 1}}, {KS_FORMAT_I16, {0, 16, 1}},
                                       {KS_FORMAT_U32, {1, 32, 1}}, {KS_FORMAT_F16, {2, 16, 1}}, {KS_FORMAT_F32, {2, 32, 1}}};

// ---- what we give ----

/// A tensor's arrays and its owner, which live until the consumer is done.
template <class M>
struct Given {
  M managed{};
  std::vector<int64_t> shape, strides;
  py::object owner;
};

template <class M>
void let_go(M* managed) {
  if (Py_IsInitialized() == 0) return;  // the interpreter has ended, and the owner with it
  const Locked gil;
  delete static_cast<Given<M>*>(managed->context);
}

/// A capsule that nobody took is let go with its tensor.
template <class M>
void end_capsule(PyObject* capsule) {
  if (!PyCapsule_IsValid(capsule, M::name)) return;
  auto* managed = static_cast<M*>(PyCapsule_GetPointer(capsule, M::name));
  managed->deleter(managed);
}

template <class M>
py::object capsule(const ks_image_desc& image, void* first, py::object owner) {
  auto given = std::make_unique<Given<M>>();
  const int64_t bytes = ks_format_bytes(image.format);
  given->shape.assign(image.shape, image.shape + image.dim_count);
  for (uint32_t k = 0; k < image.dim_count; ++k) given->strides.push_back(image.byte_stride[k] / bytes);
  given->owner = std::move(owner);
  Tensor& tensor = given->managed.tensor;
  tensor.data = first, tensor.device = {device_cpu, 0};
  tensor.ndim = static_cast<int32_t>(image.dim_count), tensor.shape = given->shape.data(), tensor.strides = given->strides.data();
  for (const Element& e : elements)
    if (e.format == image.format) tensor.dtype = e.dtype;
  given->managed.context = given.get(), given->managed.deleter = let_go<M>;
  if constexpr (std::is_same_v<M, ManagedVersioned>) given->managed.major = version_major, given->managed.minor = version_minor;
  PyObject* made = PyCapsule_New(&given->managed, M::name, end_capsule<M>);
  if (made == nullptr) throw py::error_already_set();
  given.release();  // the capsule's
  return py::reinterpret_steal<py::object>(made);
}

/// max_version: (major, minor) that the consumer reads, or None for one that asks in the legacy way.
inline py::object give(const ks_image_desc& image, void* first, py::object owner, const py::object& max_version) {
  const bool versioned = !max_version.is_none() && py::cast<uint32_t>(max_version[py::int_(0)]) >= version_major;
  return versioned ? capsule<ManagedVersioned>(image, first, std::move(owner)) : capsule<Managed>(image, first, std::move(owner));
}

// ---- what we take ----

/// Another library's array: its elements, where they are, and what keeps them.
struct Taken {
  ks_image_desc image = ks_image_desc_init();  // offset_bytes counts from `begin`
  uint64_t begin = 0, size_bytes = 0;          // address of the lowest byte, and how many there are
  py::object owner;
};

template <class M>
py::object taken_owner(const py::object& capsule, M* managed) {
  // The consumer of a tensor renames its capsule and calls the deleter once.
  if (PyCapsule_SetName(capsule.ptr(), M::used_name) != 0) throw py::error_already_set();
  return py::capsule(managed, [](void* m) {
    if (static_cast<M*>(m)->deleter != nullptr) static_cast<M*>(m)->deleter(static_cast<M*>(m));
  });
}

template <class Api>
void read(const Tensor& tensor, Taken& taken) {
  const DataType t = tensor.dtype;
  uint32_t format = 0;
  for (const Element& e : elements)
    if (e.dtype.code == t.code && e.dtype.bits == t.bits && e.dtype.lanes == t.lanes) format = e.format;
  if (format == 0)
    raise_argument<Api>("the array's elements (DLPack code " + std::to_string(t.code) + ", " + std::to_string(t.bits) +
                        " bits) fit no image: uint8, uint16, int16, uint32, float16, float32 do");
  if (tensor.device.type != device_cpu && tensor.device.type != device_cuda_host && tensor.device.type != device_cuda_managed)
    raise_argument<Api>("the array is on a device (DLPack type " + std::to_string(tensor.device.type) +
                        "), and only memory of the host is taken this way: export a Buffer as 'opaque_fd' instead");
  if (tensor.ndim < 1 || tensor.ndim > KS_MAX_DIMS)
    raise_argument<Api>("the array has " + std::to_string(tensor.ndim) + " dimensions, an image has 1 to " + std::to_string(KS_MAX_DIMS));
  const std::vector<uint64_t> shape(tensor.shape, tensor.shape + tensor.ndim);
  taken.image = ks_image_desc_packed(format, static_cast<uint32_t>(tensor.ndim), shape.data());
  const auto bytes = static_cast<int64_t>(ks_format_bytes(format));
  int64_t low = 0, high = 0;  // of the first element's address, the others' offsets
  for (int32_t k = 0; k < tensor.ndim; ++k) {
    if (tensor.shape[k] < 1) raise_argument<Api>("the array is empty");
    if (tensor.strides != nullptr) taken.image.byte_stride[k] = tensor.strides[k] * bytes;
    const int64_t reach = (tensor.shape[k] - 1) * taken.image.byte_stride[k];
    (reach < 0 ? low : high) += reach;
  }
  const uint64_t first = reinterpret_cast<uintptr_t>(tensor.data) + tensor.byte_offset;
  taken.begin = first + static_cast<uint64_t>(low);
  taken.size_bytes = static_cast<uint64_t>(high - low + bytes);
  taken.image.offset_bytes = first - taken.begin;
}

template <class Api>
Taken take(const py::object& array) {
  if (!py::hasattr(array, "__dlpack__")) raise_argument<Api>(std::string(py::str(py::type::of(array))) + " has no __dlpack__");
  py::object capsule;
  try {
    capsule = array.attr("__dlpack__")(py::arg("max_version") = py::make_tuple(version_major, version_minor));
  } catch (py::error_already_set& error) {
    if (!error.matches(PyExc_TypeError)) throw;  // a producer older than DLPack 1 does not know the argument
    capsule = array.attr("__dlpack__")();
  }
  Taken taken;
  if (PyCapsule_IsValid(capsule.ptr(), ManagedVersioned::name)) {
    auto* managed = static_cast<ManagedVersioned*>(PyCapsule_GetPointer(capsule.ptr(), ManagedVersioned::name));
    if (managed->major != version_major)
      raise_argument<Api>("the array comes in version " + std::to_string(managed->major) + " of DLPack, this reads version 1");
    if (managed->flags & flag_read_only) raise_argument<Api>("the array is read-only, and an image may be written: copy it");
    read<Api>(managed->tensor, taken);
    taken.owner = taken_owner(capsule, managed);
    return taken;
  }
  if (!PyCapsule_IsValid(capsule.ptr(), Managed::name)) raise_argument<Api>("__dlpack__ gave no DLPack capsule, or one that was taken");
  auto* managed = static_cast<Managed*>(PyCapsule_GetPointer(capsule.ptr(), Managed::name));
  read<Api>(managed->tensor, taken);
  taken.owner = taken_owner(capsule, managed);
  return taken;
}

}  // namespace ks_python::dlpack
