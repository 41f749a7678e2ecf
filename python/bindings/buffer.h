// SPDX-License-Identifier: Apache-2.0
// Buffer, BufferDesc and Image of either library. A BufferDesc made by one module is read by name in the other: no type crosses.
#pragma once

#include <unistd.h>

#include "bindings/array_pool.h"
#include "bindings/convert.h"
#include "bindings/device.h"

namespace ks_python {

inline const char* memory_name(uint32_t memory) { return memory == KS_MEMORY_HOST ? "host" : "opaque_fd"; }

template <class Api>
uint32_t memory_of(const std::string& name) {
  if (name == "host") return KS_MEMORY_HOST;
  if (name == "opaque_fd") return KS_MEMORY_OPAQUE_FD;
  raise_argument<Api>("unknown memory '" + name + "' (known: host, opaque_fd)");
}

/// An exported buffer's description. Owns the file descriptor in it, and keeps the exporter alive for host memory.
template <class Api>
struct BufferDesc {
  BufferDesc() = default;
  BufferDesc(BufferDesc&& other) noexcept : c(other.c), exporter(std::move(other.exporter)), open(std::exchange(other.open, false)) {}
  ~BufferDesc() { close(); }
  void close() {
    if (std::exchange(open, false) && c.memory == KS_MEMORY_OPAQUE_FD) ::close(static_cast<int>(c.handle));
  }
  ks_buffer_desc c = ks_buffer_desc_init();
  py::object exporter;
  bool open = false;
};

template <class Api>
class Buffer {
 public:
  Buffer(std::shared_ptr<Device<Api>> device, uint64_t size_bytes, bool exportable, bool host_visible)
      : device_(std::move(device)), size_bytes_(size_bytes) {
    const uint32_t flags = (exportable ? KS_BUFFER_EXPORTABLE : 0u) | (host_visible ? KS_BUFFER_HOST_VISIBLE : 0u);
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(size_bytes, flags);
    check_unlocked<Api>([&] { return Api::buffer_create(device_->get(), &create, handle_.put()); });
    if (host_visible) check<Api>(Api::buffer_map(get(), &address_));
  }

  Buffer(std::shared_ptr<Device<Api>> device, const py::object& source) : device_(std::move(device)) {
    ks_buffer_desc desc = ks_buffer_desc_init();
    desc.memory = memory_of<Api>(py::cast<std::string>(source.attr("memory")));
    desc.memory_type_index = py::cast<uint32_t>(source.attr("memory_type_index"));
    desc.handle = py::cast<uint64_t>(source.attr("handle"));
    desc.allocation_bytes = py::cast<uint64_t>(source.attr("allocation_bytes"));
    desc.offset_bytes = py::cast<uint64_t>(source.attr("offset_bytes"));
    desc.size_bytes = size_bytes_ = py::cast<uint64_t>(source.attr("size_bytes"));
    desc.dedicated = py::cast<bool>(source.attr("dedicated")) ? 1 : 0;
    read_uuid(source.attr("device_uuid"), desc.device_uuid);
    read_uuid(source.attr("driver_uuid"), desc.driver_uuid);
    check_unlocked<Api>([&] { return Api::buffer_import(device_->get(), &desc, handle_.put()); });
    if (desc.memory == KS_MEMORY_HOST) source_ = source;
    if (Api::buffer_map(get(), &address_) < 0) address_ = nullptr;
  }

  /// Host memory of another library's array, which `owner` keeps.
  Buffer(std::shared_ptr<Device<Api>> device, uint64_t address, uint64_t size_bytes, py::object owner)
      : device_(std::move(device)), source_(std::move(owner)), size_bytes_(size_bytes) {
    ks_buffer_desc desc = ks_buffer_desc_init();
    desc.memory = KS_MEMORY_HOST;
    desc.handle = address;
    desc.allocation_bytes = desc.size_bytes = size_bytes;
    check_unlocked<Api>([&] { return Api::buffer_import(device_->get(), &desc, handle_.put()); });
    check<Api>(Api::buffer_map(get(), &address_));
  }

  [[nodiscard]] typename Api::BufferHandle get() const { return handle_.get(); }
  [[nodiscard]] uint64_t size_bytes() const { return size_bytes_; }
  /// nullptr when the buffer is not host-visible.
  [[nodiscard]] void* address() const { return address_; }

  void write(const py::buffer& data, uint64_t offset_bytes) {
    const py::buffer_info info = data.request();
    py::ssize_t packed = info.itemsize;
    for (py::ssize_t k = info.ndim; k-- > 0; packed *= info.shape[k])
      if (info.shape[k] > 1 && info.strides[k] != packed) raise_argument<Api>("the data to write is not contiguous; copy it first");
    check_unlocked<Api>([&] { return Api::buffer_write(get(), offset_bytes, info.ptr, static_cast<uint64_t>(info.size * info.itemsize)); });
  }

  [[nodiscard]] py::array read(std::optional<uint64_t> size_bytes, uint64_t offset_bytes) const {
    if (offset_bytes > size_bytes_) raise_argument<Api>("offset " + std::to_string(offset_bytes) + " lies behind the buffer's end");
    const uint64_t count = size_bytes.value_or(size_bytes_ - offset_bytes);
    if (count > size_bytes_ - offset_bytes) raise_argument<Api>("the buffer holds " + std::to_string(size_bytes_) + " bytes only");
    py::array out = ArrayPool::make(py::dtype::of<uint8_t>(), {static_cast<py::ssize_t>(count)});
    void* data = out.mutable_data();
    check_unlocked<Api>([&] { return Api::buffer_read(get(), offset_bytes, data, count); });
    return out;
  }

 private:
  static void read_uuid(const py::object& value, uint8_t* out) {
    const std::string uuid = py::cast<std::string>(value);
    if (uuid.size() != 16) raise_argument<Api>("a UUID has 16 bytes");
    std::copy(uuid.begin(), uuid.end(), out);
  }

  std::shared_ptr<Device<Api>> device_;
  py::object source_;  // imported host memory must outlive the handle
  Handle<typename Api::BufferHandle, Api::buffer_release> handle_;
  uint64_t size_bytes_ = 0;
  void* address_ = nullptr;
};

template <class Api>
struct Image {
  std::shared_ptr<Buffer<Api>> buffer;
  ks_image_desc c;

  /// A numpy view; it keeps the buffer alive and copies nothing.
  [[nodiscard]] py::array array() const {
    const std::vector<py::ssize_t> shape(c.shape, c.shape + c.dim_count), strides(c.byte_stride, c.byte_stride + c.dim_count);
    return py::array(dtype_of(c.format), shape, strides, first(), py::cast(buffer));
  }

 private:
  [[nodiscard]] uint8_t* first() const {
    if (!buffer->address()) raise<Api>(KS_ERROR_INVALID_STATE, PyExc_BufferError, "the buffer is not host-visible; read() copies it");
    return static_cast<uint8_t*>(buffer->address()) + c.offset_bytes;
  }
};

/// Another library's array in host memory, which NumPy takes by DLPack, as an image of the device: nothing is copied.
template <class Api>
Image<Api> image_of_array(std::shared_ptr<Device<Api>> device, const py::object& array) {
  const py::object from_dlpack = py::module_::import("numpy").attr("from_dlpack");
  py::array view;
  try {
    view = from_dlpack(array);
  } catch (py::error_already_set& error) {
    raise_argument<Api>("NumPy cannot take the array by DLPack: " + std::string(py::str(error.value())) +
                        "; it must be in host memory and writable");
  }
  // NumPy before 2.1 refuses read-only arrays itself, and shows all others as read-only.
  if (!view.writeable() && py::array(from_dlpack(py::array_t<float>(1))).writeable())
    raise_argument<Api>("the array is read-only, and an image may be written: copy it");
  const uint32_t format = format_of<Api>(view.dtype());
  if (view.ndim() < 1 || view.ndim() > KS_MAX_DIMS)
    raise_argument<Api>("the array has " + std::to_string(view.ndim()) + " dimensions, an image has 1 to " + std::to_string(KS_MAX_DIMS));
  if (view.size() == 0) raise_argument<Api>("the array is empty");
  const std::vector<uint64_t> shape(view.shape(), view.shape() + view.ndim());
  ks_image_desc image = ks_image_desc_packed(format, static_cast<uint32_t>(shape.size()), shape.data());
  int64_t low = 0, high = view.itemsize();  // of the first element's address, the ends of all
  for (py::ssize_t k = 0; k < view.ndim(); ++k) {
    image.byte_stride[k] = view.strides(k);
    const int64_t reach = (view.shape(k) - 1) * view.strides(k);
    (reach < 0 ? low : high) += reach;
  }
  // A device's buffers begin at multiples of this at most (Vulkan, minStorageBufferOffsetAlignment). The bytes before the array there are
  // on a page of the array's, so they can be mapped; the image does not reach them.
  constexpr uint64_t alignment = 256;
  const uint64_t first = reinterpret_cast<uintptr_t>(view.data());
  const uint64_t begin = (first + static_cast<uint64_t>(low)) / alignment * alignment;
  image.offset_bytes = first - begin;
  return {std::make_shared<Buffer<Api>>(std::move(device), begin, first + static_cast<uint64_t>(high) - begin, std::move(view)), image};
}

/// The whole buffer as bytes.
template <class Api>
Image<Api> bytes_of(std::shared_ptr<Buffer<Api>> buffer) {
  const uint64_t size = buffer->size_bytes();
  return {std::move(buffer), ks_image_desc_packed(KS_FORMAT_U8, 1, &size)};
}

/// NumPy's array interface and DLPack, by NumPy's view of whatever has an image: Type -> Image.
template <class Api, class Class, class ToImage>
void bind_array_protocols(Class& bound, const ToImage& to_image) {
  bound
      .def_property_readonly(
          "__array_interface__",
          [to_image](const py::object& self) -> py::object { return to_image(self).array().attr("__array_interface__"); },
          "NumPy's array interface, version 3.")
      .def(
          "__dlpack__",
          [to_image](const py::object& self, const py::kwargs& asked) -> py::object {
            return to_image(self).array().attr("__dlpack__")(**asked);
          },
          "A DLPack capsule of the same memory, as NumPy's arrays give it.")
      .def(
          "__dlpack_device__", [](const py::object&) { return py::make_tuple(1, 0); }, "(1, 0): memory of the host.");
}

/// A packed view of `buffer`; throws when it reaches past the end.
template <class Api>
Image<Api> make_image(std::shared_ptr<Buffer<Api>> buffer, uint32_t format, const std::vector<uint64_t>& shape, uint64_t offset_bytes) {
  if (shape.empty() || shape.size() > KS_MAX_DIMS) raise_argument<Api>("an image has 1 to " + std::to_string(KS_MAX_DIMS) + " dimensions");
  const uint64_t limit = buffer->size_bytes();
  uint64_t bytes = ks_format_bytes(format);
  for (uint64_t extent : shape) {
    if (extent == 0 || bytes > limit / extent)
      raise_argument<Api>("the image is empty or larger than the buffer's " + std::to_string(limit) + " bytes");
    bytes *= extent;
  }
  if (offset_bytes > limit - bytes) raise_argument<Api>("the image ends behind the buffer's " + std::to_string(limit) + " bytes");
  Image<Api> image{std::move(buffer), ks_image_desc_packed(format, static_cast<uint32_t>(shape.size()), shape.data())};
  image.c.offset_bytes = offset_bytes;
  return image;
}

template <class Api>
void bind_buffer_desc(py::module_& module) {
  using Desc = BufferDesc<Api>;
  const auto bytes16 = [](const uint8_t* uuid) { return py::bytes(reinterpret_cast<const char*>(uuid), 16); };
  py::class_<Desc>(module, "BufferDesc", doc("BufferDesc"))
      .def_property_readonly("memory", [](const Desc& d) { return memory_name(d.c.memory); })
      .def_property_readonly("memory_type_index", [](const Desc& d) { return d.c.memory_type_index; })
      .def_property_readonly(
          "handle",
          [](const Desc& d) {  // a closed descriptor's number may be another file's by now
            if (d.c.memory == KS_MEMORY_OPAQUE_FD && !d.open) raise_argument<Api>("this description was closed: export the buffer again");
            return d.c.handle;
          },
          doc("BufferDesc.handle"))
      .def_property_readonly("allocation_bytes", [](const Desc& d) { return d.c.allocation_bytes; })
      .def_property_readonly("offset_bytes", [](const Desc& d) { return d.c.offset_bytes; })
      .def_property_readonly("size_bytes", [](const Desc& d) { return d.c.size_bytes; })
      .def_property_readonly("dedicated", [](const Desc& d) { return d.c.dedicated != 0; })
      .def_property_readonly("device_uuid", [=](const Desc& d) { return bytes16(d.c.device_uuid); })
      .def_property_readonly("driver_uuid", [=](const Desc& d) { return bytes16(d.c.driver_uuid); })
      .def("close", &Desc::close)
      .def("__enter__", [](py::object self) { return self; })
      .def("__exit__", [](Desc& d, const py::args&) { d.close(); });
}

template <class Api>
void bind_buffer(py::module_& module) {
#if PYBIND11_VERSION_HEX < 0x020C0000  // older ones read the sizes of NumPy 2's types as 0
  const auto numpy = py::module_::import("numpy").attr("__version__").cast<std::string>();
  if (numpy.rfind("1.", 0) != 0)
    throw py::import_error("this build is for NumPy 1, and " + numpy +
                           " is installed: pip install 'numpy<2', or build a wheel (bash python/wheels.sh)");
#endif
  bind_buffer_desc<Api>(module);
  using B = Buffer<Api>;
  using Shared = std::shared_ptr<B>;
  py::class_<B, Shared> buffer(module, "Buffer", py::buffer_protocol(), doc("Buffer"));
  buffer
      .def(py::init<std::shared_ptr<Device<Api>>, uint64_t, bool, bool>(), py::arg("device").none(false), py::arg("size_bytes"),
           py::kw_only(), py::arg("exportable") = false, py::arg("host_visible") = true)
      .def_static(
          "import_",
          [](std::shared_ptr<Device<Api>> device, const py::object& desc) { return std::make_shared<B>(std::move(device), desc); },
          py::arg("device").none(false), py::arg("desc"), doc("Buffer.import_"))
      .def_property_readonly("size_bytes", &B::size_bytes)
      .def(
          "export",
          [](const Shared& self, const std::string& memory) {
            BufferDesc<Api> desc;
            check<Api>(Api::buffer_export(self->get(), memory_of<Api>(memory), &desc.c));
            desc.open = true;
            desc.exporter = py::cast(self);
            return desc;
          },
          py::arg("memory") = "opaque_fd", doc("Buffer.export"))
      .def("write", &B::write, py::arg("data"), py::arg("offset_bytes") = 0, doc("Buffer.write"))
      .def("read", &B::read, py::arg("size_bytes") = py::none(), py::arg("offset_bytes") = 0, doc("Buffer.read"))
      .def(
          "image",
          [](const Shared& self, const py::object& dtype, const std::vector<uint64_t>& shape, uint64_t offset_bytes) {
            return make_image<Api>(self, format_of<Api>(py::dtype::from_args(dtype)), shape, offset_bytes);
          },
          py::arg("dtype"), py::arg("shape"), py::arg("offset_bytes") = 0, doc("Buffer.image"))
      .def_buffer([](B& b) {
        const py::ssize_t size = b.address() ? static_cast<py::ssize_t>(b.size_bytes()) : 0;
        return py::buffer_info(static_cast<uint8_t*>(b.address()), size);
      });

  bind_array_protocols<Api>(buffer, [](const py::object& self) { return bytes_of<Api>(py::cast<Shared>(self)); });

  using I = Image<Api>;
  py::class_<I> image(module, "Image", doc("Image"));
  bind_array_protocols<Api>(image, [](const py::object& self) { return py::cast<I>(self); });
  image.def_static("from_dlpack", &image_of_array<Api>, py::arg("device").none(false), py::arg("array"), doc("Image.from_dlpack"))
      .def_property_readonly("buffer", [](const I& i) { return i.buffer; })
      .def_property_readonly("shape",
                             [](const I& i) { return py::tuple(py::cast(std::vector<uint64_t>(i.c.shape, i.c.shape + i.c.dim_count))); })
      .def_property_readonly("dtype", [](const I& i) { return dtype_of(i.c.format); })
      .def_property_readonly("offset_bytes", [](const I& i) { return i.c.offset_bytes; })
      .def("array", &I::array, doc("Image.array"));
}

}  // namespace ks_python
