// SPDX-License-Identifier: Apache-2.0
// Material, Light, Camera, Optics, Medium: built from keyword arguments, every field a property under its C name. None stands for "no
// texture" and "not said".
#include "fields.h"

namespace ks_python {
namespace {

/// Fields of every record are set by name; an unknown name is a TypeError that lists the known ones.
void set_fields(const py::object& self, const py::kwargs& fields) {
  for (const auto& [name, value] : fields) {
    if (!py::hasattr(self, name)) {
      const std::string type = py::str(py::type::of(self).attr("__name__"));
      std::string message = type;
      message.append(" has no field '").append(std::string(py::str(name))).append("'; see help(kuafu.").append(type).append(")");
      throw py::type_error(message);
    }
    py::setattr(self, name, value);
  }
}

template <class Record>
Record from_fields(const py::kwargs& fields) {
  Record record;
  set_fields(py::cast(&record, py::return_value_policy::reference), fields);
  return record;
}

/// A record's class, with its fields and, where it has one, its name.
template <class Record>
py::class_<Record> bind_record(py::module_& module, const char* name, const char* doc) {
  py::class_<Record> type(module, name, doc);
  type.def(py::init(&from_fields<Record>));
  if constexpr (requires(Record record) { record.name; }) type.def_readwrite("name", &Record::name);
  bind_fields(type);
  return type;
}

void bind_light(py::module_& module) {
  bind_record<Light>(module, "Light", doc("Light"))
      .def_property(
          "dots",
          [](const Light& l) {
            return py::array_t<float>(std::vector<py::ssize_t>{py::ssize_t(l.dots.size() / 3), 3}, l.dots.data());
          },
          [](Light& l, const std::optional<py::array_t<float, py::array::c_style | py::array::forcecast>>& dots) {
            if (dots && (dots->ndim() != 2 || dots->shape(1) != 3))
              raise_argument<Kuafu>("dots have shape " + std::string(py::str(dots->attr("shape"))) + ", they need (n, 3)");
            l.dots = dots ? std::vector<float>(dots->data(), dots->data() + dots->size()) : std::vector<float>();
          },
          doc("Light.dots"));
}

void bind_camera(py::module_& module) {
  py::class_<Camera> type(module, "Camera", doc("Camera"));
  type.def(py::init([](uint32_t width, uint32_t height, const py::object& k, const py::object& camera_to_world, double near_m, double far_m,
                       const py::kwargs& fields) {
             Camera camera;
             camera.c.width = width;
             camera.c.height = height;
             camera.c.near_m = near_m;
             camera.c.far_m = far_m;
             read_matrix<Kuafu>(k, "k", camera.c.k, 9);
             read_matrix<Kuafu>(camera_to_world, "camera_to_world", camera.c.camera_to_world, 16);
             set_fields(py::cast(&camera, py::return_value_policy::reference), fields);
             return camera;
           }),
           py::arg("width"), py::arg("height"), py::arg("k"), py::arg("camera_to_world") = py::none(), py::arg("near_m") = 0.0,
           py::arg("far_m") = INFINITY);
  bind_fields(type);
}

}  // namespace

void bind_records(py::module_& module) {
  bind_record<Material>(module, "Material", doc("Material"));
  bind_light(module);
  bind_camera(module);
  bind_record<Optics>(module, "Optics", doc("Optics"));
  bind_record<Medium>(module, "Medium", doc("Medium"));
}

}  // namespace ks_python
