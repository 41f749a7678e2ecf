// Material, Light, Camera, Film: built from keyword arguments, every field a property under its C name. None stands for "no texture" and
// "not said".
#include "records.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

namespace ks_python {
namespace {

/// Fields of every record are set by name; an unknown name is a TypeError that lists the known ones.
template <class Record>
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
  set_fields<Record>(py::cast(&record, py::return_value_policy::reference), fields);
  return record;
}

template <class Record, class Desc, class T>
void scalar(py::class_<Record>& type, const char* name, T Desc::*member, const char* doc = "") {
  type.def_property(
      name, [member](const Record& r) { return r.c.*member; }, [member](Record& r, T value) { r.c.*member = value; }, doc);
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

/// 0xffffffff in C (KUAFU_NONE, KUAFU_ALL_ENVIRONMENTS), None in Python.
template <class Record, class Desc>
void maybe(py::class_<Record>& type, const char* name, uint32_t Desc::*member, const char* doc = "Texture id, or None.") {
  type.def_property(
      name, [member](const Record& r) { return r.c.*member == KUAFU_NONE ? std::optional<uint32_t>() : r.c.*member; },
      [member](Record& r, std::optional<uint32_t> value) { r.c.*member = value.value_or(KUAFU_NONE); }, doc);
}

void bind_material(py::module_& module) {
  py::class_<Material> type(module, "Material", "glTF 2.0's material (GGX, alpha = roughness squared). Every field is a keyword argument.");
  type.def(py::init(&from_fields<Material>));
  type.def_readwrite("name", &Material::name);
  vector(type, "base_color", &kuafu_material_desc::base_color, "Linear RGB and alpha.");
  scalar(type, "metallic", &kuafu_material_desc::metallic, "0..1");
  scalar(type, "roughness", &kuafu_material_desc::roughness, "0..1");
  scalar(type, "specular", &kuafu_material_desc::specular, "0..1; 0 with metallic 0 is exactly Lambertian.");
  scalar(type, "ior", &kuafu_material_desc::ior, ">= 1");
  scalar(type, "transmission", &kuafu_material_desc::transmission, "0..1");
  vector(type, "emission", &kuafu_material_desc::emission, "Visible radiance, W/(sr m^2).");
  maybe(type, "ir_albedo", &kuafu_material_desc::ir_albedo, "Diffuse albedo in the infrared band; None = red of the base colour.");
  scalar(type, "ir_emission", &kuafu_material_desc::ir_emission, "Infrared radiance, W/(sr m^2).");
  maybe(type, "base_color_texture", &kuafu_material_desc::base_color_texture);
  maybe(type, "metallic_roughness_texture", &kuafu_material_desc::metallic_roughness_texture);
  maybe(type, "normal_texture", &kuafu_material_desc::normal_texture);
  maybe(type, "emission_texture", &kuafu_material_desc::emission_texture);
  maybe(type, "transmission_texture", &kuafu_material_desc::transmission_texture);
  maybe(type, "specular_texture", &kuafu_material_desc::specular_texture);
  scalar(type, "transmission_roughness", &kuafu_material_desc::transmission_roughness, "Of the glass, 0..1; 0 = clear.");
  scalar(type, "diffuse_roughness", &kuafu_material_desc::diffuse_roughness, "0..1: Oren and Nayar's, in Fujii's form; 0 = Lambert.");
  vector(type, "attenuation_color", &kuafu_material_desc::attenuation_color, "Of white light after attenuation_distance_m inside.");
  maybe(type, "ir_attenuation_color", &kuafu_material_desc::ir_attenuation_color, "The same in the infrared; None = red.");
  scalar(type, "attenuation_distance_m", &kuafu_material_desc::attenuation_distance_m, "0 = nothing is absorbed.");
  scalar(type, "light_group", &kuafu_material_desc::light_group, "0..3: which group of outputs its emission belongs to.");
  maybe(type, "ior_texture", &kuafu_material_desc::ior_texture, "R: ior = 1 + (ior - 1) R.");
  maybe(type, "ir_albedo_texture", &kuafu_material_desc::ir_albedo_texture, "R, times ir_albedo (1 where that is None).");
  maybe(type, "ir_roughness", &kuafu_material_desc::ir_roughness, "In the infrared band; None = as roughness.");
  maybe(type, "ir_ior", &kuafu_material_desc::ir_ior, "In the infrared band; None = as ior.");
  maybe(type, "ir_transmission", &kuafu_material_desc::ir_transmission, "In the infrared band; None = as transmission.");
  maybe(type, "ir_transmission_roughness", &kuafu_material_desc::ir_transmission_roughness, "None = as transmission_roughness.");
  scalar(type, "subsurface", &kuafu_material_desc::subsurface, "0..1: share of the diffuse base whose light wanders below the surface.");
  vector(type, "subsurface_color", &kuafu_material_desc::subsurface_color, "Its albedo, 0..1; base_color does not tint it.");
  vector(type, "subsurface_radius_m", &kuafu_material_desc::subsurface_radius_m, "Its mean free path.");
  maybe(type, "ir_subsurface_color", &kuafu_material_desc::ir_subsurface_color, "In the infrared band; None = red.");
  maybe(type, "ir_subsurface_radius_m", &kuafu_material_desc::ir_subsurface_radius_m, "In the infrared band; None = red.");
  type.def_property(
      "thin_walled", [](const Material& m) { return m.c.thin_walled != 0; }, [](Material& m, bool thin) { m.c.thin_walled = thin ? 1 : 0; },
      "Its glass is a sheet, not the skin of a body: light goes through both faces at once and straight on.");
  type.def_property(
      "bsdf", [](const Material& m) { return m.c.bsdf == KUAFU_BSDF_PAPER ? "paper" : "gltf"; },
      [](Material& m, const std::string& bsdf) {
        if (bsdf != "gltf" && bsdf != "paper") raise_argument<Kuafu>("unknown bsdf '" + bsdf + "' (known: gltf, paper)");
        m.c.bsdf = bsdf == "paper" ? KUAFU_BSDF_PAPER : KUAFU_BSDF_GLTF;
      },
      "'gltf' (default), or 'paper': w f_diffuse + (1 - w) f_specular, w = (1 - metallic)(1 - transmission).");
}

// By KUAFU_LIGHT_*, which count from 1.
constexpr std::array<std::string_view, 6> light_kinds = {"point", "projector", "directional", "spot", "rectangle", "disk"};

void bind_light(py::module_& module) {
  py::class_<Light> type(module, "Light", "A point light or a pattern projector. Every field is a keyword argument.");
  type.def(py::init(&from_fields<Light>));
  type.def_readwrite("name", &Light::name);
  type.def_property(
      "kind", [](const Light& l) { return light_kinds[l.c.kind - 1]; },
      [](Light& l, const std::string& kind) {
        const auto found = std::ranges::find(light_kinds, kind);
        if (found == light_kinds.end())
          raise_argument<Kuafu>("unknown light kind '" + kind + "' (known: point, projector, directional, spot, rectangle, disk)");
        l.c.kind = static_cast<uint32_t>(found - light_kinds.begin()) + 1;
      },
      "'point' (default), 'projector', 'directional', 'spot', 'rectangle' or 'disk'.");
  vector(type, "intensity", &kuafu_light_desc::intensity,
         "Visible radiant intensity, W/sr; 0 for a projector that an RGB camera does not see.");
  maybe(type, "ir_intensity", &kuafu_light_desc::ir_intensity,
        "Infrared radiant intensity, W/sr; None = red of intensity times ir_ambient_scale.");
  square(type, "light_to_world", &kuafu_light_desc::light_to_world, "4x4; +z is a projector's axis, x right, y down.");
  square(type, "k", &kuafu_light_desc::k, "Projector: 3x3 in pixels of the texture.");
  maybe(type, "texture", &kuafu_light_desc::texture, "Projector: id of the pattern, red channel read linearly.");
  scalar(type, "radius_m", &kuafu_light_desc::radius_m, "Point: of the sphere that shines; disk; projector: of its lens.");
  scalar(type, "angle_rad", &kuafu_light_desc::angle_rad, "Directional: half angle of its disc.");
  scalar(type, "inner_rad", &kuafu_light_desc::inner_rad, "Spot: half angle that is fully lit.");
  scalar(type, "outer_rad", &kuafu_light_desc::outer_rad, "Spot: half angle where it ends.");
  vector(type, "size_m", &kuafu_light_desc::size_m, "Rectangle: width and height; directional with a texture: of a tile.");
  vector(type, "distortion", &kuafu_light_desc::distortion, "Projector: k1 k2 p1 p2 k3 k4 k5 k6 (OpenCV's order).");
  scalar(type, "falloff", &kuafu_light_desc::falloff, "Projector: n of cos^n.");
  scalar(type, "focus_m", &kuafu_light_desc::focus_m, "Projector: distance of its sharpest image; 0 = sharp everywhere.");
  scalar(type, "pattern_scale", &kuafu_light_desc::pattern_scale,
         "Projector: magnifies the pattern about the principal point; 1 = neutral.");
  type.def_property(
      "dots",
      [](const Light& l) {
        return py::array_t<float>(std::vector<py::ssize_t>{py::ssize_t(l.dots.size() / 3), 3}, l.dots.data());
      },
      [](Light& l, const std::optional<py::array_t<float, py::array::c_style | py::array::forcecast>>& dots) {
        if (dots && (dots->ndim() != 2 || dots->shape(1) != 3))
          raise_argument<Kuafu>("dots have shape " + std::string(py::str(dots->attr("shape"))) + ", they need (n, 3)");
        l.dots = dots ? std::vector<float>(dots->data(), dots->data() + dots->size()) : std::vector<float>();
      },
      "Projector: [n, 3] u, v in pixels and power, in place of a texture; power is the pattern's integral over the dot in pixels squared.");
  scalar(type, "pattern_width", &kuafu_light_desc::pattern_width, "Of the dots' image, whose pixels k and dots count.");
  scalar(type, "pattern_height", &kuafu_light_desc::pattern_height, "Of the dots' image.");
  scalar(type, "dot_sigma_px", &kuafu_light_desc::dot_sigma_px, "Of each dot, a Gaussian.");
  scalar(type, "light_group", &kuafu_light_desc::light_group, "0..3: which group of outputs it belongs to; projectors have their own.");
  vector(type, "linear_velocity", &kuafu_light_desc::linear_velocity, "m/s, in the light's own frame.");
  vector(type, "angular_velocity", &kuafu_light_desc::angular_velocity, "rad/s, in the light's own frame: pose exp(t [linear, angular]).");
  scalar(type, "on_from_s", &kuafu_light_desc::on_from_s, "It shines from here of the frame's time; equal to on_until_s: always.");
  scalar(type, "on_until_s", &kuafu_light_desc::on_until_s, "Until here.");
  maybe(type, "environment", &kuafu_light_desc::environment, "Which environment of a batch has it; None = all.");
}

constexpr std::array<std::string_view, 2> shutters = {"global", "rolling"};                                      // by KUAFU_SHUTTER_*
constexpr std::array<std::string_view, 4> readouts = {"rows_down", "rows_up", "columns_right", "columns_left"};  // by KUAFU_READOUT_*

/// A C constant that counts from 0, by its name in Python.
template <class Record, class Desc, size_t n>
void named(py::class_<Record>& type, const char* name, uint32_t Desc::*member, const std::array<std::string_view, n>& names,
           const char* doc) {
  type.def_property(
      name, [member, &names](const Record& r) { return names.at(r.c.*member); },
      [member, &names, name](Record& r, const std::string& value) {
        const auto found = std::ranges::find(names, value);
        std::string known;
        for (const std::string_view text : names) known += (known.empty() ? "" : ", ") + std::string(text);
        if (found == names.end()) raise_argument<Kuafu>("unknown " + std::string(name) + " '" + value + "' (known: " + known + ")");
        r.c.*member = uint32_t(found - names.begin());
      },
      doc);
}

void bind_camera(py::module_& module) {
  py::class_<Camera> type(
      module, "Camera",
      "A camera: x right, y down, z forward; pixel centres at integers. A pinhole at rest unless its lens, shutter or velocity "
      "say more; every field is a keyword argument. Time 0 is mid-exposure of the middle line.");
  type.def(py::init([](uint32_t width, uint32_t height, const py::object& k, const py::object& camera_to_world, double near_m, double far_m,
                       const py::kwargs& fields) {
             Camera camera;
             camera.c.width = width;
             camera.c.height = height;
             camera.c.near_m = near_m;
             camera.c.far_m = far_m;
             read_matrix<Kuafu>(k, "k", camera.c.k, 9);
             read_matrix<Kuafu>(camera_to_world, "camera_to_world", camera.c.camera_to_world, 16);
             set_fields<Camera>(py::cast(&camera, py::return_value_policy::reference), fields);
             return camera;
           }),
           py::arg("width"), py::arg("height"), py::arg("k"), py::arg("camera_to_world") = py::none(), py::arg("near_m") = 0.0,
           py::arg("far_m") = INFINITY);
  scalar(type, "width", &kuafu_camera_desc::width);
  scalar(type, "height", &kuafu_camera_desc::height);
  square(type, "k", &kuafu_camera_desc::k, "3x3, pixels.");
  square(type, "camera_to_world", &kuafu_camera_desc::camera_to_world, "4x4");
  scalar(type, "near_m", &kuafu_camera_desc::near_m, "Nearer hits are not seen.");
  scalar(type, "far_m", &kuafu_camera_desc::far_m, "Farther hits are not seen.");
  type.def_property(
      "distortion", [](const Camera& camera) { return py::tuple(py::cast(std::to_array(camera.c.distortion))); },
      [](Camera& camera, const std::vector<double>& values) {
        if (values.size() != 4 && values.size() != 5 && values.size() != 8)
          raise_argument<Kuafu>("distortion has " + std::to_string(values.size()) + " numbers, it needs 4, 5 or 8");
        std::ranges::fill(camera.c.distortion, 0.0);
        std::ranges::copy(values, camera.c.distortion);
      },
      "k1 k2 p1 p2 k3 k4 k5 k6 (OpenCV's order; 4 or 5 of them leave the others 0): from ideal to seen pixels.");
  scalar(type, "lens_radius_m", &kuafu_camera_desc::lens_radius_m, "Of a thin lens' aperture; 0 = pinhole.");
  scalar(type, "focus_m", &kuafu_camera_desc::focus_m, "z of the sharp plane, > 0.");
  named(type, "shutter", &kuafu_camera_desc::shutter, shutters, "'global' (default) or 'rolling'.");
  named(type, "readout", &kuafu_camera_desc::readout, readouts,
        "Of a rolling shutter: 'rows_down' (default: row 0 first), 'rows_up', 'columns_right' or 'columns_left'.");
  scalar(type, "exposure_s", &kuafu_camera_desc::exposure_s, "Of each line; 0 = an instant.");
  scalar(type, "line_time_s", &kuafu_camera_desc::line_time_s, "From one line to the next, of a rolling shutter.");
  vector(type, "linear_velocity", &kuafu_camera_desc::linear_velocity, "m/s, in the camera's own frame.");
  vector(type, "angular_velocity", &kuafu_camera_desc::angular_velocity,
         "rad/s, in the camera's own frame: pose(t) = camera_to_world exp(t [linear, angular]).");
}

void bind_film(py::module_& module) {
  py::class_<Film> type(
      module, "Film", "A camera's optics on linear light, neutral by default. Every field is a keyword argument; applied in their order.");
  type.def(py::init(&from_fields<Film>));
  scalar(type, "vignetting_exponent", &kuafu_film_desc::vignetting_exponent, "n of cos^n of the angle to the axis; 4 is a thin lens'.");
  vector(type, "vignetting_polynomial", &kuafu_film_desc::vignetting_polynomial,
         "a1, a2, a3 of 1 + a1 r^2 + a2 r^4 + a3 r^6; r is 1 in the corners.");
  scalar(type, "defocus_lens_radius_m", &kuafu_film_desc::defocus_lens_radius_m, "0 = sharp everywhere.");
  scalar(type, "defocus_focus_m", &kuafu_film_desc::defocus_focus_m, "Distance that is sharp.");
  scalar(type, "psf_sigma_px", &kuafu_film_desc::psf_sigma_px, "Gaussian of the whole image.");
  scalar(type, "psf_corner_sigma_px", &kuafu_film_desc::psf_corner_sigma_px, "Its part that grows with r^2, in the corners.");
  scalar(type, "veiling_glare_fraction", &kuafu_film_desc::veiling_glare_fraction, "Of the light, spread evenly over the image.");
}

}  // namespace

void bind_records(py::module_& module) {
  bind_material(module);
  bind_light(module);
  bind_camera(module);
  bind_film(module);
}

}  // namespace ks_python
