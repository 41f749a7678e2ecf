// SPDX-License-Identifier: Apache-2.0
// Scene: what kuafu_scene_* do, with numpy arrays.
#include "records.h"

#include "bindings/wait.h"
#include "fields.h"

#include <pybind11/stl/filesystem.h>

#include <algorithm>

namespace ks_python {
namespace {

/// Python numbers what is in a scene from 0, C from 1.
uint32_t id_of(uint32_t number) { return number + 1; }
uint32_t number_of(uint32_t id) { return id - 1; }

std::vector<uint32_t> ids_of(std::vector<uint32_t> numbers) {
  std::ranges::transform(numbers, numbers.begin(), id_of);
  return numbers;
}

template <ks_status (*call)(kuafu_scene, uint32_t)>
void remove(Scene& s, uint32_t number) {
  check<Kuafu>(call(s.get(), id_of(number)));
}

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;
using Vector3 = std::array<double, 3>;
using Indices = py::array_t<uint32_t, py::array::c_style | py::array::forcecast>;

void load(Scene& scene, const std::filesystem::path& path, const py::object& root_to_world, std::optional<double> time_s,
          const std::optional<std::filesystem::path>& name) {
  double root[16];
  read_matrix<Kuafu>(root_to_world, "root_to_world", root, 16);
  const Outcome outcome = run_interruptibly<Kuafu>(
      [&] { return kuafu_scene_load(scene.get(), path.c_str(), name ? name->c_str() : nullptr, root_to_world.is_none() ? nullptr : root); },
      [&] { return kuafu_scene_cancel_load(scene.get()); });
  check_file<Kuafu>(outcome.status, outcome.message, path);
  if (time_s) check<Kuafu>(kuafu_scene_animate(scene.get(), KUAFU_ALL_ANIMATIONS, *time_s));
}

void animate(Scene& scene, double time_s, std::optional<uint32_t> animation) {
  check<Kuafu>(kuafu_scene_animate(scene.get(), animation.value_or(KUAFU_ALL_ANIMATIONS), time_s));
}

double animation_duration_s(const Scene& scene, uint32_t animation) {
  double seconds = 0.0;
  check<Kuafu>(kuafu_scene_animation_duration(scene.get(), animation, &seconds));
  return seconds;
}

/// The array's rows, after checking that it is [rows][columns]; `rows` < 0 accepts any count.
template <class Array>
const typename Array::value_type* rows(const std::optional<Array>& array, const char* what, py::ssize_t columns, py::ssize_t count) {
  if (!array) return nullptr;
  const bool shaped = columns == 1 ? array->ndim() == 1 : array->ndim() == 2 && array->shape(1) == columns;
  if (!shaped || (count >= 0 && array->shape(0) != count))
    raise_argument<Kuafu>(std::string(what) + " has shape " + std::string(py::str(array->attr("shape"))) + ", it needs (" +
                          (count < 0 ? "n" : std::to_string(count)) + ", " + std::to_string(columns) + ")");
  return array->data();
}

/// Whole numbers from 0 to 2^32 - 1 as they are: numpy's own conversion would cut 0.5 to 0 and wrap 2^32 around to it.
std::optional<Indices> whole_numbers(const py::object& given, const char* what) {
  if (given.is_none()) return std::nullopt;
  const py::array array = py::array::ensure(given);
  if (!array) throw py::error_already_set();
  const char kind = array.dtype().kind();
  if (array.size() > 0) {
    if (kind != 'i' && kind != 'u')
      raise_argument<Kuafu>(std::string(what) + " are " + std::string(py::str(array.dtype())) + ", they must be whole numbers");
    const py::object low = array.attr("min")(), high = array.attr("max")();
    if (low < py::int_(0) || high > py::int_(0xffffffffu))
      raise_argument<Kuafu>(std::string(what) + " go from " + std::string(py::str(low)) + " to " + std::string(py::str(high)) +
                            ", they must be from 0 to 2^32 - 1");
  }
  return Indices(array);
}

uint32_t add_mesh(Scene& scene, const std::optional<Floats>& positions, const py::object& given_indices,
                  const std::optional<Floats>& normals, const std::optional<Floats>& uvs, const py::object& given_slots,
                  const std::string& name, const std::optional<Floats>& uvs_1, const std::optional<Floats>& colors) {
  const std::optional<Indices> indices = whole_numbers(given_indices, "indices"), slots = whole_numbers(given_slots, "slots");
  kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
  mesh.name = name.c_str();
  mesh.positions = rows(positions, "positions", 3, -1);
  mesh.indices = rows(indices, "indices", 3, -1);
  if (!mesh.positions || !mesh.indices) raise_argument<Kuafu>("a mesh needs positions and indices");
  mesh.vertex_count = static_cast<uint32_t>(positions->shape(0));
  mesh.triangle_count = static_cast<uint32_t>(indices->shape(0));
  mesh.normals = rows(normals, "normals", 3, mesh.vertex_count);
  mesh.uvs = rows(uvs, "uvs", 2, mesh.vertex_count);
  mesh.uvs_1 = rows(uvs_1, "uvs_1", 2, mesh.vertex_count);
  mesh.colors = rows(colors, "colors", 4, mesh.vertex_count);
  mesh.slots = rows(slots, "slots", 1, mesh.triangle_count);
  uint32_t id = 0;
  check<Kuafu>(kuafu_scene_add_mesh(scene.get(), &mesh, &id));
  return number_of(id);
}

void update_mesh(Scene& scene, uint32_t id, const std::optional<Floats>& positions, const std::optional<Floats>& normals) {
  const float* p = rows(positions, "positions", 3, -1);
  if (!p) raise_argument<Kuafu>("a mesh needs positions");
  const float* n = rows(normals, "normals", 3, positions->shape(0));
  check<Kuafu>(kuafu_scene_update_mesh(scene.get(), id_of(id), p, n, static_cast<uint32_t>(positions->shape(0))));
}

/// How materials read a texture, in Python's words.
struct TextureLook {
  std::array<std::string, 2> wrap;  // u and v
  std::string filter;
  uint32_t uv_set;
  std::optional<std::array<std::array<float, 3>, 2>> uv_transform;

  void put_into(kuafu_texture_desc& texture) const {
    constexpr std::array wraps{"repeat", "clamp", "mirror"};
    texture.wrap_u = index_of_name<Kuafu>(wraps, wrap[0], "wrap");
    texture.wrap_v = index_of_name<Kuafu>(wraps, wrap[1], "wrap");
    texture.filter = index_of_name<Kuafu>(std::array{"linear", "nearest"}, filter, "filter");
    texture.uv_set = uv_set;
    if (uv_transform)
      for (size_t i = 0; i < 6; ++i) texture.uv_transform[i] = (*uv_transform)[i / 3][i % 3];
  }
};

/// Hands the texels to `take` as a descriptor, which lives until it returns.
template <class Take>
void with_texture(const py::array& texels, const TextureLook& look, bool srgb, const std::string& name, const Take& take) {
  const py::array packed = py::array::ensure(texels, py::array::c_style);
  if (packed.ndim() != 2 && packed.ndim() != 3) raise_argument<Kuafu>("texels must be [height][width] or [height][width][channels]");
  kuafu_texture_desc texture = kuafu_texture_desc_init();
  texture.name = name.c_str();
  texture.texels = packed.data();
  texture.height = static_cast<uint32_t>(packed.shape(0));
  texture.width = static_cast<uint32_t>(packed.shape(1));
  texture.channels = packed.ndim() == 3 ? static_cast<uint32_t>(packed.shape(2)) : 1;
  texture.format = format_of<Kuafu>(packed.dtype());
  texture.srgb = srgb ? 1 : 0;
  look.put_into(texture);
  check<Kuafu>(take(texture));
}

uint32_t add_texture(Scene& scene, const py::array& texels, bool srgb, const std::string& name, const std::array<std::string, 2>& wrap,
                     const std::string& filter, uint32_t uv_set, const std::optional<std::array<std::array<float, 3>, 2>>& uv_transform) {
  uint32_t id = 0;
  with_texture(texels, {wrap, filter, uv_set, uv_transform}, srgb, name,
               [&](const kuafu_texture_desc& t) { return kuafu_scene_add_texture(scene.get(), &t, &id); });
  return number_of(id);
}

void set_texture(Scene& scene, uint32_t id, const py::array& texels, bool srgb, const std::string& name,
                 const std::array<std::string, 2>& wrap, const std::string& filter, uint32_t uv_set,
                 const std::optional<std::array<std::array<float, 3>, 2>>& uv_transform) {
  with_texture(texels, {wrap, filter, uv_set, uv_transform}, srgb, name,
               [&](const kuafu_texture_desc& t) { return kuafu_scene_set_texture(scene.get(), id_of(id), &t); });
}

uint32_t add_instance(Scene& scene, uint32_t mesh, const std::vector<uint32_t>& materials, const py::object& local_to_world,
                      const std::optional<uint32_t>& environment, uint32_t semantic_id, const std::string& name,
                      const Vector3& linear_velocity, const Vector3& angular_velocity) {
  kuafu_instance_desc instance = kuafu_instance_desc_init(id_of(mesh));
  instance.name = name.c_str();
  instance.environment = environment.value_or(KUAFU_ALL_ENVIRONMENTS);
  const std::vector<uint32_t> ids = ids_of(materials);
  instance.materials = ids.data();
  instance.material_count = static_cast<uint32_t>(ids.size());
  instance.semantic_id = semantic_id;
  read_matrix<Kuafu>(local_to_world, "local_to_world", instance.local_to_world, 16);
  std::ranges::copy(linear_velocity, instance.linear_velocity);
  std::ranges::copy(angular_velocity, instance.angular_velocity);
  uint32_t id = 0;
  check<Kuafu>(kuafu_scene_add_instance(scene.get(), &instance, &id));
  return number_of(id);
}

void set_instance_pose(Scene& scene, uint32_t id, const py::object& local_to_world) {
  double pose[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  read_matrix<Kuafu>(local_to_world, "local_to_world", pose, 16);
  check<Kuafu>(kuafu_scene_set_instance_pose(scene.get(), id_of(id), pose));
}

void set_instance_poses(Scene& scene, const py::object& given_ids, const Doubles& local_to_world) {
  const std::optional<Indices> given = whole_numbers(given_ids, "ids");
  const uint32_t* numbers = rows(given, "ids", 1, -1);
  const bool shaped = local_to_world.ndim() == 3 && local_to_world.shape(1) == 4 && local_to_world.shape(2) == 4;
  if (!numbers || !shaped || local_to_world.shape(0) != given->shape(0))
    raise_argument<Kuafu>("local_to_world has shape " + std::string(py::str(local_to_world.attr("shape"))) + ", it needs (" +
                          (numbers ? std::to_string(given->shape(0)) : "n") + ", 4, 4): one for each of ids");
  const std::vector<uint32_t> ids = ids_of({numbers, numbers + given->shape(0)});
  check<Kuafu>(kuafu_scene_set_instance_poses(scene.get(), ids.data(), local_to_world.data(), static_cast<uint32_t>(ids.size())));
}

void set_instance_velocity(Scene& scene, uint32_t id, const Vector3& linear, const Vector3& angular) {
  check<Kuafu>(kuafu_scene_set_instance_velocity(scene.get(), id_of(id), linear.data(), angular.data()));
}

void set_instance_materials(Scene& scene, uint32_t id, const std::vector<uint32_t>& materials) {
  const std::vector<uint32_t> ids = ids_of(materials);
  check<Kuafu>(kuafu_scene_set_instance_materials(scene.get(), id_of(id), ids.data(), static_cast<uint32_t>(ids.size())));
}

void set_environment(Scene& scene, const std::array<float, 3>& radiance, std::optional<float> ir_radiance,
                     const std::optional<uint32_t>& texture, const py::object& map_to_world, uint32_t light_group) {
  kuafu_environment_desc environment = kuafu_environment_desc_init();
  std::copy(radiance.begin(), radiance.end(), environment.radiance);
  if (ir_radiance) environment.ir_radiance = *ir_radiance;
  if (texture) environment.texture = id_of(*texture);
  environment.light_group = light_group;
  read_matrix<Kuafu>(map_to_world, "map_to_world", environment.map_to_world, 9);
  check<Kuafu>(kuafu_scene_set_environment(scene.get(), &environment));
}

void set_medium(Scene& scene, const Medium* medium) { check<Kuafu>(kuafu_scene_set_medium(scene.get(), medium ? &medium->c : nullptr)); }

kuafu_scene_summary summary(const Scene& scene) {
  kuafu_scene_summary s = kuafu_scene_summary_init();
  check<Kuafu>(kuafu_scene_get_summary(scene.get(), &s));
  return s;
}

Camera camera(const Scene& scene, uint32_t index) {
  Camera out;
  check<Kuafu>(kuafu_scene_get_camera(scene.get(), index, &out.c));
  return out;
}

using SceneType = py::class_<Scene, std::shared_ptr<Scene>>;

/// add_<kind> and set_<kind>, of a record that the library takes as one descriptor.
template <class Record, auto add, auto set>
void bind_record(SceneType& type, const std::string& kind) {
  type.def(("add_" + kind).c_str(),
           [](Scene& s, const Record& record) {
             const auto desc = record.desc();
             uint32_t id = 0;
             check<Kuafu>(add(s.get(), &desc, &id));
             return number_of(id);
           },
           py::arg(kind.c_str()));
  type.def(("set_" + kind).c_str(),
           [](Scene& s, uint32_t id, const Record& record) {
             const auto desc = record.desc();
             check<Kuafu>(set(s.get(), id_of(id), &desc));
           },
           py::arg("id"), py::arg(kind.c_str()));
}

/// A copy; None from NULL.
template <class T>
py::object copy_of(const T* data, std::vector<py::ssize_t> shape) {
  return data == nullptr ? py::none() : py::object(py::array_t<T>(std::move(shape), data));
}

py::dict get_mesh(const Scene& s, uint32_t id) {
  kuafu_mesh_desc m = kuafu_mesh_desc_init();
  check<Kuafu>(kuafu_scene_get_mesh(s.get(), id_of(id), &m));
  const py::ssize_t n = m.vertex_count, t = m.triangle_count;
  using namespace py::literals;
  return py::dict("positions"_a = copy_of(m.positions, {n, 3}), "indices"_a = copy_of(m.indices, {t, 3}),
                  "normals"_a = copy_of(m.normals, {n, 3}), "uvs"_a = copy_of(m.uvs, {n, 2}), "slots"_a = copy_of(m.slots, {t}),
                  "name"_a = text_of(m.name), "uvs_1"_a = copy_of(m.uvs_1, {n, 2}), "colors"_a = copy_of(m.colors, {n, 4}));
}

py::dict get_texture(const Scene& s, uint32_t id) {
  kuafu_texture_desc t = kuafu_texture_desc_init();
  check<Kuafu>(kuafu_scene_get_texture(s.get(), id_of(id), &t));
  const char* const type = t.format == KS_FORMAT_U8 ? "u1" : t.format == KS_FORMAT_U16 ? "u2" : "f4";
  const std::array wraps{"repeat", "clamp", "mirror"};
  using namespace py::literals;
  const bool moved = std::ranges::any_of(t.uv_transform, [](float v) { return v != 0.0f; });
  return py::dict("texels"_a = py::array(py::dtype(type), {t.height, t.width, t.channels}, t.texels), "srgb"_a = t.srgb != 0,
                  "name"_a = text_of(t.name), "wrap"_a = py::make_tuple(wraps.at(t.wrap_u), wraps.at(t.wrap_v)),
                  "filter"_a = t.filter == KUAFU_FILTER_LINEAR ? "linear" : "nearest", "uv_set"_a = t.uv_set,
                  "uv_transform"_a = copy_of(moved ? t.uv_transform : nullptr, {2, 3}));
}

py::dict get_instance(const Scene& s, uint32_t id) {
  kuafu_instance_desc i = kuafu_instance_desc_init(0);
  check<Kuafu>(kuafu_scene_get_instance(s.get(), id_of(id), &i));
  py::list materials;
  for (uint32_t m = 0; m < i.material_count; ++m)
    materials.append(i.materials[m] == 0 ? py::none() : py::object(py::int_(number_of(i.materials[m]))));
  using namespace py::literals;
  return py::dict("mesh"_a = number_of(i.mesh), "materials"_a = materials, "local_to_world"_a = copy_of(i.local_to_world, {4, 4}),
                  "environment"_a = i.environment == KUAFU_ALL_ENVIRONMENTS ? py::none() : py::object(py::int_(i.environment)),
                  "semantic_id"_a = i.semantic_id, "name"_a = text_of(i.name));
}

Material get_material(const Scene& s, uint32_t id) {
  Material m;
  check<Kuafu>(kuafu_scene_get_material(s.get(), id_of(id), &m.c));
  m.name = text_of(m.c.name);
  return m;
}

Light get_light(const Scene& s, uint32_t id) {
  Light l;
  check<Kuafu>(kuafu_scene_get_light(s.get(), id_of(id), &l.c));
  l.name = text_of(l.c.name);
  l.dots.assign(l.c.dots, l.c.dots + size_t{3} * l.c.dot_count);
  return l;
}

void set_lights(Scene& s, const std::vector<uint32_t>& ids, const std::vector<const Light*>& lights) {
  if (ids.size() != lights.size())
    raise_argument<Kuafu>("there are " + std::to_string(ids.size()) + " ids and " + std::to_string(lights.size()) + " lights");
  std::vector<kuafu_light_desc> descs;
  for (const Light* light : lights) {
    if (!light) raise_argument<Kuafu>("one of lights is None");
    descs.push_back(light->desc());
  }
  check<Kuafu>(kuafu_scene_set_lights(s.get(), ids_of(ids).data(), descs.data(), static_cast<uint32_t>(ids.size())));
}

}  // namespace

void bind_scene(py::module_& module) {
  py::class_<kuafu_scene_summary> summary_type(module, "SceneSummary", doc("SceneSummary"));
  bind_fields(summary_type);
  SceneType type(module, "Scene", doc("Scene"));
  type.def(py::init<std::shared_ptr<Device<Kuafu>>>(), py::arg("device").none(false))
      .def_property_readonly("device", [](const Scene& s) { return s.device; })
      .def_property_readonly("summary", &summary)
      .def("load", &load, py::arg("path"), py::arg("root_to_world") = py::none(), py::kw_only(), py::arg("time_s") = py::none(),
           py::arg("name") = py::none(), doc("Scene.load"))
      .def("animate", &animate, py::arg("time_s"), py::arg("animation") = py::none(), doc("Scene.animate"))
      .def("animation_duration_s", &animation_duration_s, py::arg("animation"), doc("Scene.animation_duration_s"))
      .def(
          "animation_name", [](const Scene& s, uint32_t id) { return text_of(kuafu_scene_animation_name(s.get(), id)); },
          py::arg("animation"))
      .def("add_mesh", &add_mesh, py::arg("positions"), py::arg("indices"), py::kw_only(), py::arg("normals") = py::none(),
           py::arg("uvs") = py::none(), py::arg("slots") = py::none(), py::arg("name") = "", py::arg("uvs_1") = py::none(),
           py::arg("colors") = py::none(), doc("Scene.add_mesh"))
      .def("update_mesh", &update_mesh, py::arg("id"), py::arg("positions"), py::arg("normals") = py::none(), doc("Scene.update_mesh"))
      .def("add_texture", &add_texture, py::arg("texels"), py::kw_only(), py::arg("srgb") = false, py::arg("name") = "",
           py::arg("wrap") = std::array<std::string, 2>{"repeat", "repeat"}, py::arg("filter") = "linear", py::arg("uv_set") = 0,
           py::arg("uv_transform") = py::none(), doc("Scene.add_texture"))
      .def("set_texture", &set_texture, py::arg("id"), py::arg("texels"), py::kw_only(), py::arg("srgb") = false, py::arg("name") = "",
           py::arg("wrap") = std::array<std::string, 2>{"repeat", "repeat"}, py::arg("filter") = "linear", py::arg("uv_set") = 0,
           py::arg("uv_transform") = py::none(), doc("Scene.set_texture"))
      .def("add_instance", &add_instance, py::arg("mesh"), py::arg("materials") = std::vector<uint32_t>(), py::kw_only(),
           py::arg("local_to_world") = py::none(), py::arg("environment") = py::none(), py::arg("semantic_id") = 0, py::arg("name") = "",
           py::arg("linear_velocity") = Vector3{}, py::arg("angular_velocity") = Vector3{}, doc("Scene.add_instance"))
      .def("set_instance_pose", &set_instance_pose, py::arg("id"), py::arg("local_to_world"))
      .def("set_instance_poses", &set_instance_poses, py::arg("ids"), py::arg("local_to_world"), doc("Scene.set_instance_poses"))
      .def("set_instance_velocity", &set_instance_velocity, py::arg("id"), py::arg("linear"), py::arg("angular") = Vector3{},
           doc("Scene.set_instance_velocity"))
      .def("set_instance_materials", &set_instance_materials, py::arg("id"), py::arg("materials"))
      .def("remove_mesh", &remove<kuafu_scene_remove_mesh>, py::arg("id"), doc("Scene.remove_mesh"))
      .def("remove_texture", &remove<kuafu_scene_remove_texture>, py::arg("id"), doc("Scene.remove_texture"))
      .def("remove_material", &remove<kuafu_scene_remove_material>, py::arg("id"), doc("Scene.remove_material"))
      .def("remove_instance", &remove<kuafu_scene_remove_instance>, py::arg("id"))
      .def(
          "next_frame", [](Scene& s) { check<Kuafu>(kuafu_scene_next_frame(s.get())); }, doc("Scene.next_frame"))
      .def("set_environment", &set_environment, py::arg("radiance"), py::arg("ir_radiance") = py::none(), py::kw_only(),
           py::arg("texture") = py::none(), py::arg("map_to_world") = py::none(), py::arg("light_group") = 0, doc("Scene.set_environment"))
      .def("set_medium", &set_medium, py::arg("medium").none(true), doc("Scene.set_medium"))
      .def("camera", &camera, py::arg("index"), doc("Scene.camera"))
      .def(
          "instance_name", [](const Scene& s, uint32_t id) { return text_of(kuafu_scene_instance_name(s.get(), id_of(id))); },
          py::arg("id"))
      .def(
          "material_name", [](const Scene& s, uint32_t id) { return text_of(kuafu_scene_material_name(s.get(), id_of(id))); },
          py::arg("id"));
  bind_record<Material, kuafu_scene_add_material, kuafu_scene_set_material>(type, "material");
  bind_record<Light, kuafu_scene_add_light, kuafu_scene_set_light>(type, "light");
  type.def("get_mesh", &get_mesh, py::arg("id"), doc("Scene.get_mesh"));
  type.def("get_texture", &get_texture, py::arg("id"), doc("Scene.get_texture"));
  type.def("get_instance", &get_instance, py::arg("id"), doc("Scene.get_instance"));
  type.def("get_material", &get_material, py::arg("id"));
  type.def("get_light", &get_light, py::arg("id"));
  type.def("set_lights", &set_lights, py::arg("ids"), py::arg("lights"), doc("Scene.set_lights"));
  type.def("remove_light", &remove<kuafu_scene_remove_light>, py::arg("id"));
}

}  // namespace ks_python
