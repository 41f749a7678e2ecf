// SPDX-License-Identifier: Apache-2.0
// Device and DeviceInfo of either library.
#pragma once

#include <memory>
#include <optional>

#include "bindings/convert.h"
#include "docs.h"

namespace ks_python {

template <class Api>
struct DeviceInfo {
  ks_device_info c = ks_device_info_init();
};

template <class Api>
class Device {
 public:
  Device(const py::object& select, uint32_t worker_count, bool validation, const py::object& log,
         const std::optional<std::string>& cache_directory)
      : log_(log) {
    ks_device_desc desc = ks_device_desc_init();
    ks_vulkan_device lent = ks_vulkan_device_init();
    if (py::hasattr(select, "_lend")) {  // a Device, perhaps of the other library
      lent = *select.attr("_lend")().cast<py::capsule>().template get_pointer<ks_vulkan_device>();
      desc.select = KS_SELECT_VULKAN;
      desc.vulkan = &lent;
      lender_ = select;
    } else {
      read_select(select, desc);
    }
    desc.worker_count = worker_count;
    desc.validation = validation ? 1 : 0;
    desc.cache_directory = cache_directory ? cache_directory->c_str() : nullptr;
    if (log.is_none()) log_ = logger();
    desc.log = &Device::call_log;
    desc.log_user = &log_;
    check_unlocked<Api>([&] { return Api::device_create(&desc, handle_.put()); });
  }

  [[nodiscard]] typename Api::DeviceHandle get() const { return handle_.get(); }
  [[nodiscard]] DeviceInfo<Api> info() const {
    DeviceInfo<Api> info;
    check<Api>(Api::device_get_info(get(), &info.c));
    return info;
  }
  /// Bytes that the library counts; count: a function of the C interface.
  template <auto count>
  [[nodiscard]] uint64_t bytes() const {
    uint64_t bytes = 0;
    check<Api>(count(get(), &bytes));
    return bytes;
  }
  /// A ks_vulkan_device of this device, which must outlive its users.
  [[nodiscard]] py::capsule lend() const {
    auto lent = std::make_unique<ks_vulkan_device>(ks_vulkan_device_init());
    check<Api>(Api::device_lend(get(), lent.get()));
    py::capsule capsule(lent.get(), [](void* kept) { delete static_cast<ks_vulkan_device*>(kept); });
    lent.release();
    return capsule;
  }

  static std::vector<DeviceInfo<Api>> enumerate() {
    uint32_t count = 0;
    check<Api>(Api::device_enumerate(nullptr, &count));
    std::vector<ks_device_info> infos(count, ks_device_info_init());
    if (count) check<Api>(Api::device_enumerate(infos.data(), &count));
    std::vector<DeviceInfo<Api>> out;
    for (uint32_t i = 0; i < std::min<size_t>(count, infos.size()); ++i) out.push_back({infos[i]});
    return out;
  }

 private:
  static void read_select(const py::object& select, ks_device_desc& desc) {
    if (py::isinstance<py::bytes>(select)) {
      const std::string uuid = py::cast<std::string>(select);
      if (uuid.size() != 16) raise_argument<Api>("a device UUID has 16 bytes, not " + std::to_string(uuid.size()));
      desc.select = KS_SELECT_UUID;
      std::copy(uuid.begin(), uuid.end(), desc.uuid);
      return;
    }
    const std::string text = py::str(select);
    const bool number =
        !text.empty() && text.size() < 10 && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (number) {
      desc.select = KS_SELECT_INDEX;
      desc.index = static_cast<uint32_t>(std::stoul(text));
    } else if (text == "auto") {
      desc.select = KS_SELECT_AUTO;
    } else if (text == "cpu") {
      desc.select = KS_SELECT_CPU;
    } else if (text == "host") {
      desc.select = KS_SELECT_HOST;
    } else {
      raise_argument<Api>("unknown device '" + text + "' (known: auto, cpu, host, an index, 16 bytes of UUID, a Device)");
    }
  }

  /// Messages of the library where nobody else asked for them: to Python's logging, which shows warnings unless it is set otherwise.
  static py::object logger() {
    const py::object log = py::module_::import("logging").attr("getLogger")(Api::name).attr("log");
    return py::cpp_function([log](uint32_t level, const py::str& text) {
      constexpr int levels[] = {10, 30, 40};  // logging's DEBUG, WARNING and ERROR for KS_LOG_INFO and on
      log(levels[std::min<uint32_t>(level, 2)], "%s", text);
    });
  }

  static void call_log(void* user, uint32_t level, const char* text) {
    if (interpreter_ends()) return;
    const Locked gil;
    try {
      (*static_cast<py::object*>(user))(level, decoded(text));
    } catch (py::error_already_set& e) {
      e.discard_as_unraisable("log callback");
    }
  }

  py::object lender_;  // of the VkDevice
  py::object log_;     // outlives the handle, and every child of ours holds this Device
  Handle<typename Api::DeviceHandle, Api::device_release> handle_;
};

inline const char* kind_name(uint32_t kind) {
  constexpr const char* names[] = {"host", "cpu", "integrated gpu", "discrete gpu", "virtual gpu"};
  return kind < 5 ? names[kind] : "other";
}

inline std::vector<std::string> capability_names(uint64_t bits) {
  constexpr std::pair<uint64_t, const char*> names[] = {
      {KS_CAP_EXPORT_OPAQUE_FD, "export_opaque_fd"},         {KS_CAP_IMPORT_OPAQUE_FD, "import_opaque_fd"},
      {KS_CAP_EXPORT_HOST_POINTER, "export_host_pointer"},   {KS_CAP_IMPORT_HOST_POINTER, "import_host_pointer"},
      {KS_CAP_RAY_TRACING_PIPELINE, "ray_tracing_pipeline"}, {KS_CAP_TIMELINE_FD, "timeline_fd"}};
  std::vector<std::string> out;
  for (const auto& [bit, name] : names)
    if (bits & bit) out.emplace_back(name);
  return out;
}

template <class Api>
void bind_device(py::module_& module) {
  using Info = DeviceInfo<Api>;
  const auto bytes16 = [](const uint8_t* uuid) { return py::bytes(reinterpret_cast<const char*>(uuid), 16); };
  py::class_<Info>(module, "DeviceInfo", doc("DeviceInfo"))
      .def_property_readonly("name", [](const Info& i) { return std::string(i.c.name); })
      .def_property_readonly("driver", [](const Info& i) { return std::string(i.c.driver); })
      .def_property_readonly(
          "refused", [](const Info& i) { return std::string(i.c.refused); }, doc("DeviceInfo.refused"))
      .def_property_readonly("device_uuid", [=](const Info& i) { return bytes16(i.c.device_uuid); })
      .def_property_readonly("driver_uuid", [=](const Info& i) { return bytes16(i.c.driver_uuid); })
      .def_property_readonly("index", [](const Info& i) { return i.c.index; })
      .def_property_readonly("kind", [](const Info& i) { return kind_name(i.c.kind); })
      .def_property_readonly("api_version",
                             [](const Info& i) {
                               const uint32_t v = i.c.api_version;  // Vulkan's packing: 7 bits major, 10 minor, 12 patch
                               return std::to_string(v >> 22 & 127) + "." + std::to_string(v >> 12 & 1023) + "." + std::to_string(v & 4095);
                             })
      .def_property_readonly("usable", [](const Info& i) { return i.c.usable != 0; })
      .def_property_readonly("capabilities", [](const Info& i) { return capability_names(i.c.capabilities); })
      .def_property_readonly("memory_bytes", [](const Info& i) { return i.c.memory_bytes; })
      .def("__repr__",
           [](const Info& i) { return "<DeviceInfo " + std::to_string(i.c.index) + " '" + i.c.name + "' " + kind_name(i.c.kind) + ">"; });

  using D = Device<Api>;
  py::class_<D, std::shared_ptr<D>>(module, "Device", doc("Device"))
      .def(py::init<const py::object&, uint32_t, bool, const py::object&, const std::optional<std::string>&>(), py::arg("select") = "auto",
           py::kw_only(), py::arg("worker_count") = 0, py::arg("validation") = false, py::arg("log") = py::none(),
           py::arg("cache_directory") = py::none(), doc("Device.__init__"))
      .def_static("enumerate", &D::enumerate, doc("Device.enumerate"))
      .def_property_readonly("info", &D::info)
      .def("_lend", &D::lend, doc("Device._lend"))
      .def_property_readonly("copied_bytes", &D::template bytes<Api::device_copied_bytes>, doc("Device.copied_bytes"))
      .def_property_readonly("allocated_bytes", &D::template bytes<Api::device_allocated_bytes>, doc("Device.allocated_bytes"));
}

}  // namespace ks_python
