// SPDX-License-Identifier: Apache-2.0
// Renderer: cameras in, arrays out. Arrays are views of host-visible buffers, or the caller's own buffers are filled.
#include <algorithm>
#include <limits>
#include <map>

#include "bindings/wait.h"
#include "fields.h"
#include "options.h"
#include "records.h"

namespace ks_python {
namespace {

struct Output {
  const char* name;
  uint32_t output;
  uint32_t channels;  // 0: one in the infrared, three in the visible band
  uint32_t format;
};
constexpr Output outputs_known[] = {{"radiance", KUAFU_OUTPUT_RADIANCE, 0, KS_FORMAT_F32},
                                    {"projector_direct", KUAFU_OUTPUT_PROJECTOR_DIRECT, 0, KS_FORMAT_F32},
                                    {"projector_indirect", KUAFU_OUTPUT_PROJECTOR_INDIRECT, 0, KS_FORMAT_F32},
                                    {"projector", KUAFU_OUTPUT_PROJECTOR, 0, KS_FORMAT_F32},
                                    {"ambient", KUAFU_OUTPUT_AMBIENT, 0, KS_FORMAT_F32},
                                    {"light_group_0", KUAFU_OUTPUT_LIGHT_GROUP_0, 0, KS_FORMAT_F32},
                                    {"light_group_1", KUAFU_OUTPUT_LIGHT_GROUP_0 + 1, 0, KS_FORMAT_F32},
                                    {"light_group_2", KUAFU_OUTPUT_LIGHT_GROUP_0 + 2, 0, KS_FORMAT_F32},
                                    {"light_group_3", KUAFU_OUTPUT_LIGHT_GROUP_0 + 3, 0, KS_FORMAT_F32},
                                    {"ambient_direct", KUAFU_OUTPUT_AMBIENT_DIRECT, 0, KS_FORMAT_F32},
                                    {"variance", KUAFU_OUTPUT_VARIANCE, 0, KS_FORMAT_F32},
                                    {"sample_count", KUAFU_OUTPUT_SAMPLE_COUNT, 1, KS_FORMAT_U32},
                                    {"srgb", KUAFU_OUTPUT_SRGB, 4, KS_FORMAT_U8},
                                    {"depth", KUAFU_OUTPUT_DEPTH, 1, KS_FORMAT_F32},
                                    {"normal", KUAFU_OUTPUT_NORMAL, 3, KS_FORMAT_F32},
                                    {"instance_id", KUAFU_OUTPUT_INSTANCE_ID, 1, KS_FORMAT_U32},
                                    {"material_id", KUAFU_OUTPUT_MATERIAL_ID, 1, KS_FORMAT_U32},
                                    {"semantic_id", KUAFU_OUTPUT_SEMANTIC_ID, 1, KS_FORMAT_U32},
                                    {"position", KUAFU_OUTPUT_POSITION, 3, KS_FORMAT_F32},
                                    {"albedo", KUAFU_OUTPUT_ALBEDO, 0, KS_FORMAT_F32},
                                    {"roughness", KUAFU_OUTPUT_ROUGHNESS, 1, KS_FORMAT_F32},
                                    {"transmission", KUAFU_OUTPUT_TRANSMISSION, 1, KS_FORMAT_F32},
                                    {"projector_uv", KUAFU_OUTPUT_PROJECTOR_UV, 2, KS_FORMAT_F32},
                                    {"projector_visibility", KUAFU_OUTPUT_PROJECTOR_VISIBILITY, 1, KS_FORMAT_F32},
                                    {"projector_geometry", KUAFU_OUTPUT_PROJECTOR_GEOMETRY, 1, KS_FORMAT_F32},
                                    {"motion", KUAFU_OUTPUT_MOTION, 2, KS_FORMAT_F32}};

/// The caller's arguments that are not in the call's C descriptor.
struct Call {
  py::object cameras, outputs;
  std::string band;
  std::optional<std::vector<uint32_t>> environments;
  py::object optics, previous_poses;
  std::map<std::string, float> scales;
  py::object progress;
};

template <class Desc, size_t count>
void set_options(Desc& desc, const Field<Desc> (&fields)[count], const py::kwargs& options, const char* what) {
  for (const auto& [key, value] : options)
    if (const std::string name = py::str(key); !set_field<Kuafu>(desc, fields, name, value))
      throw py::type_error(std::string(what) + " has no argument '" + name + "'; see help(kuafu.Renderer)");
}

class Renderer {
 public:
  Renderer(std::shared_ptr<Device<Kuafu>> device, const std::optional<std::string>& oidn_library, const py::kwargs& options)
      : device_(std::move(device)) {
    kuafu_renderer_desc desc = kuafu_renderer_desc_init();
    desc.oidn_library = oidn_library ? oidn_library->c_str() : nullptr;
    set_options(desc, renderer_fields, options, "Renderer");
    check_unlocked<Kuafu>([&] { return kuafu_renderer_create(device_->get(), &desc, handle_.put()); });
  }

  /// A render under way ends first, and its thread may want to tell the log.
  ~Renderer() {
    const Unlocked nogil;
    handle_.reset();
  }
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  [[nodiscard]] kuafu_renderer get() const { return handle_.get(); }
  [[nodiscard]] const std::shared_ptr<Device<Kuafu>>& device() const { return device_; }

  py::dict render(Scene& scene, const Call& call, kuafu_render_desc desc) {
    const Arguments arguments(*this, call, desc);
    Progress(call.progress).check<Kuafu>(desc, [&] { return kuafu_renderer_render(get(), scene.get(), &desc); });
    return arguments.arrays;
  }

  /// The arrays are the caller's to read after wait().
  std::pair<ks_sync, py::dict> submit(Scene& scene, const Call& call, kuafu_render_desc desc) {
    if (!call.progress.is_none()) raise_argument<Kuafu>("submit takes no progress: ask the submission whether it has ended");
    const Arguments arguments(*this, call, desc);
    ks_sync submission = ks_sync_init();
    check_unlocked<Kuafu>([&] { return kuafu_renderer_submit(get(), scene.get(), &desc, &submission); });
    return {submission, arguments.arrays};
  }

  /// left, right: {name: Buffer} of depth, normal, albedo and material. numbers: by environment, or None.
  py::dict light_gbuffers(Scene& scene, const Call& call, const py::dict& left, const py::object& right, const py::object& projector_depth,
                          const std::string& depth_kind, const py::object& laser_power, const py::object& ambient_radiance,
                          uint32_t environment_count, float pixel_blur_px, uint32_t supersampling) {
    std::vector<kuafu_view_desc> views = read_views(call.cameras, "infrared", std::nullopt);
    if (views.size() != 2) raise_argument<Kuafu>("a pair has two cameras, not " + std::to_string(views.size()));
    const std::vector<Optics> optics = read_optics(call.optics, views.size());
    for (size_t i = 0; i < optics.size(); ++i) views[i].optics = &optics[i].c;
    std::vector<kuafu_output_desc> outputs;
    py::dict arrays;
    read_outputs(call, views, outputs, arrays, uint64_t{2} * environment_count);
    const kuafu_gbuffer given[2] = {gbuffer_of(left), right.is_none() ? kuafu_gbuffer_init() : gbuffer_of(py::cast<py::dict>(right))};
    const auto power = numbers_of(laser_power, environment_count, "laser_power"),
               ambient = numbers_of(ambient_radiance, environment_count, "ambient_radiance");
    kuafu_gbuffer_desc desc = kuafu_gbuffer_desc_init();
    desc.left_view = &views[0];
    desc.right_view = &views[1];
    desc.left = &given[0];
    desc.right = right.is_none() ? nullptr : &given[1];
    desc.projector_depth = projector_depth.is_none() ? nullptr : py::cast<Buffer<Kuafu>&>(projector_depth).get();
    desc.laser_power = power.empty() ? nullptr : power.data();
    desc.ambient_radiance = ambient.empty() ? nullptr : ambient.data();
    desc.outputs = outputs.data();
    desc.output_count = static_cast<uint32_t>(outputs.size());
    desc.environment_count = environment_count;
    desc.pixel_blur_px = pixel_blur_px;
    desc.supersampling = supersampling;
    desc.depth_kind = index_of_name<Kuafu>(std::array{"planar", "ray"}, depth_kind, "depth_kind");
    check_unlocked<Kuafu>([&] { return kuafu_renderer_light_gbuffers(get(), scene.get(), &desc); });
    return arrays;
  }

  /// false: it has not ended yet. Signals are heard while it waits.
  bool wait(const ks_sync& submission, double timeout_s) {
    return wait_in_slices<Kuafu>(timeout_s, [&](uint64_t slice_ns) { return kuafu_renderer_wait(get(), &submission, slice_ns); });
  }

  void cancel() { check<Kuafu>(kuafu_renderer_cancel(get())); }

 private:
  /// Memory to which a call's descriptor points.
  struct Arguments {
    Arguments(const Renderer& renderer, const Call& call, kuafu_render_desc& desc)
        : views(read_views(call.cameras, call.band, call.environments)), optics(read_optics(call.optics, views.size())) {
      read_previous_poses(call.previous_poses, views);
      for (size_t i = 0; i < optics.size(); ++i) views[i].optics = &optics[i].c;
      renderer.read_outputs(call, views, outputs, arrays, views.size());
      desc.views = views.data();
      desc.view_count = static_cast<uint32_t>(views.size());
      desc.outputs = outputs.data();
      desc.output_count = static_cast<uint32_t>(outputs.size());
    }
    Arguments(const Arguments&) = delete;
    Arguments& operator=(const Arguments&) = delete;
    std::vector<kuafu_view_desc> views;
    std::vector<Optics> optics;
    std::vector<kuafu_output_desc> outputs;
    py::dict arrays;
  };

  static std::vector<kuafu_view_desc> read_views(const py::object& cameras, const std::string& band,
                                                 const std::optional<std::vector<uint32_t>>& environments) {
    if (band != "infrared" && band != "visible") raise_argument<Kuafu>("unknown band '" + band + "' (known: infrared, visible)");
    const auto list =
        py::isinstance<Camera>(cameras) ? std::vector<Camera>{py::cast<Camera>(cameras)} : py::cast<std::vector<Camera>>(cameras);
    if (list.empty()) raise_argument<Kuafu>("give at least one camera");
    if (environments && environments->size() != list.size())
      raise_argument<Kuafu>(std::to_string(environments->size()) + " environments for " + std::to_string(list.size()) + " cameras");
    std::vector<kuafu_view_desc> views;
    for (size_t i = 0; i < list.size(); ++i) {
      kuafu_view_desc view = kuafu_view_desc_init();
      view.camera = list[i].c;
      view.band = band == "visible" ? KUAFU_BAND_VISIBLE : KUAFU_BAND_INFRARED;
      view.environment = environments ? (*environments)[i] : 0;
      views.push_back(view);
    }
    return views;
  }

  /// None, one Optics for all views, or one for each; a dict of its fields stands for an Optics.
  static std::vector<Optics> read_optics(const py::object& given, size_t view_count) {
    if (given.is_none()) return {};
    const auto one = [](const py::object& value) {
      return py::isinstance<py::dict>(value) ? py::cast<Optics>(py::type::of<Optics>()(**value)) : py::cast<Optics>(value);
    };
    if (py::isinstance<Optics>(given) || py::isinstance<py::dict>(given)) return std::vector<Optics>(view_count, one(given));
    std::vector<Optics> optics;
    for (const py::handle item : given) optics.push_back(one(py::reinterpret_borrow<py::object>(item)));
    if (optics.size() != view_count)
      raise_argument<Kuafu>(std::to_string(optics.size()) + " optics for " + std::to_string(view_count) + " cameras");
    return optics;
  }

  static kuafu_gbuffer gbuffer_of(const py::dict& images) {
    kuafu_gbuffer out = kuafu_gbuffer_init();
    for (const auto& [key, image] : images) {
      const uint32_t kind = index_of_name<Kuafu>(std::array{"depth", "normal", "albedo", "material"}, std::string(py::str(key)), "image");
      *std::array{&out.depth, &out.normal, &out.albedo, &out.material}[kind] = py::cast<Buffer<Kuafu>&>(image).get();
    }
    return out;
  }

  static std::vector<float> numbers_of(const py::object& values, uint32_t count, const char* name) {
    if (values.is_none()) return {};
    const auto array = py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(values);
    if (!array) throw py::error_already_set();
    if (array.ndim() != 1 || array.shape(0) != static_cast<py::ssize_t>(count))
      raise_argument<Kuafu>(std::string(name) + " has shape " + std::string(py::str(array.attr("shape"))) + ", it must be (" +
                            std::to_string(count) + ",)");
    return {array.data(), array.data() + count};
  }

  /// One pose for all views, or one for each.
  static void read_previous_poses(const py::object& poses, std::vector<kuafu_view_desc>& views) {
    if (poses.is_none()) return;
    const auto array = Doubles::ensure(poses);
    if (!array) throw py::error_already_set();
    const bool one = array.ndim() == 2,
               right = (one || array.ndim() == 3) && array.shape(array.ndim() - 1) == 4 && array.shape(array.ndim() - 2) == 4;
    if (!right || (!one && static_cast<size_t>(array.shape(0)) != views.size()))
      raise_argument<Kuafu>("previous_poses has shape " + std::string(py::str(array.attr("shape"))) + ", it must be (4, 4) or (" +
                            std::to_string(views.size()) + ", 4, 4)");
    for (size_t i = 0; i < views.size(); ++i) std::copy_n(array.data() + (one ? 0 : 16 * i), 16, views[i].previous_camera_to_world);
  }

  /// `outputs`: names (buffers are made) or {name: dtype, Image or Buffer}. Fills the C descriptors and the arrays to return.
  void read_outputs(const Call& call, const std::vector<kuafu_view_desc>& views, std::vector<kuafu_output_desc>& c_outputs,
                    py::dict& arrays, uint64_t view_count) const {
    const py::object& outputs = call.outputs;
    for (const auto& [name, scale] : call.scales)
      if (!outputs.contains(name)) raise_argument<Kuafu>("scales has '" + name + "', which is no output of this call");
    const bool given = py::isinstance<py::dict>(outputs);
    if (py::isinstance<py::str>(outputs)) raise_argument<Kuafu>("outputs is a sequence of names, not one name");
    for (const py::handle item : outputs) {
      const std::string name = py::cast<std::string>(item);
      const Output& o = outputs_known[index_of_name<Kuafu>(outputs_known, name, "output", &Output::name)];
      const uint32_t channels = o.channels ? o.channels : views[0].band == KUAFU_BAND_VISIBLE ? 3 : 1;
      const std::vector<uint64_t> shape = {view_count, views[0].camera.height, views[0].camera.width, channels};
      const Image<Kuafu> image = given ? given_image(outputs[item], o, shape) : new_image(o.format, shape);
      c_outputs.push_back(kuafu_output_desc_init(o.output, image.buffer->get(), image.c));
      if (const auto scale = call.scales.find(name); scale != call.scales.end()) c_outputs.back().scale = scale->second;
      arrays[item] = image.buffer->address() ? py::object(image.array()) : py::cast(image);
    }
  }

  [[nodiscard]] Image<Kuafu> new_image(uint32_t format, const std::vector<uint64_t>& shape) const {
    uint64_t bytes = ks_format_bytes(format);
    for (const uint64_t extent : shape) bytes *= extent;
    return make_image<Kuafu>(std::make_shared<Buffer<Kuafu>>(device_, bytes, false, true), format, shape, 0);
  }

  [[nodiscard]] Image<Kuafu> given_image(const py::object& target, const Output& o, const std::vector<uint64_t>& shape) const {
    if (py::isinstance<Image<Kuafu>>(target)) return py::cast<Image<Kuafu>>(target);
    if (py::isinstance<Buffer<Kuafu>>(target))
      return make_image<Kuafu>(py::cast<std::shared_ptr<Buffer<Kuafu>>>(target), o.format, shape, 0);
    if (target.is_none()) return new_image(o.format, shape);
    py::dtype dtype;
    try {
      dtype = py::dtype::from_args(target);
    } catch (const py::error_already_set&) {
      raise_argument<Kuafu>(std::string("output '") + o.name + "' needs a dtype, a kuafu.Image or a kuafu.Buffer");
    }
    return new_image(format_of<Kuafu>(dtype), shape);
  }

  std::shared_ptr<Device<Kuafu>> device_;
  Handle<kuafu_renderer, kuafu_renderer_release> handle_;
};

/// A render that Renderer.submit has begun: keeps the renderer, and the buffers that it fills.
struct Submission {
  py::object renderer;
  ks_sync sync;
  py::dict arrays;

  [[nodiscard]] py::object wait(std::optional<double> timeout_s) const {
    if (!renderer.cast<Renderer&>().wait(sync, seconds_to_wait<Kuafu>(timeout_s)))
      raise<Kuafu>(KS_ERROR_TIMEOUT, PyExc_TimeoutError, "the render has not ended; it goes on");
    return arrays;
  }
  [[nodiscard]] bool ended() const { return renderer.cast<Renderer&>().wait(sync, 0.0); }
};

/// Renderer's method `name`, of all settings of a render; `call` takes them as they stand in a Call and a descriptor.
template <class F>
void def_render(py::class_<Renderer>& renderer, const char* name, F call, const char* doc) {
  renderer.def(
      name,
      [call, name](const py::object& self, Scene& scene, const py::object& cameras, const py::object& outputs, const std::string& band,
                   const std::optional<std::vector<uint32_t>>& environments, const py::object& optics, const py::object& previous_poses,
                   const std::map<std::string, float>& scales, const py::object& progress, const py::kwargs& options) {
        kuafu_render_desc desc = kuafu_render_desc_init();
        set_options(desc, render_fields, options, name);
        return call(self, scene, Call{cameras, outputs, band, environments, optics, previous_poses, scales, progress}, desc);
      },
      py::arg("scene"), py::arg("cameras"), py::arg("outputs") = py::make_tuple("radiance"), py::kw_only(), py::arg("band") = "infrared",
      py::arg("environments") = py::none(), py::arg("optics") = py::none(), py::arg("previous_poses") = py::none(),
      py::arg("scales") = std::map<std::string, float>(), py::arg("progress") = py::none(), doc);
}

}  // namespace

void bind_renderer(py::module_& module) {
  py::class_<kuafu_render_summary> summary(module, "RenderSummary", doc("RenderSummary"));
  bind_fields(summary);
  py::class_<Submission>(module, "Submission", doc("Submission"))
      .def("wait", &Submission::wait, py::arg("timeout_s") = py::none(), doc("Submission.wait"))
      .def_property_readonly("ended", &Submission::ended, doc("Submission.ended"));
  py::class_<Renderer> renderer(module, "Renderer", doc("Renderer"));
  renderer
      .def(py::init<std::shared_ptr<Device<Kuafu>>, const std::optional<std::string>&, const py::kwargs&>(), py::arg("device").none(false),
           py::kw_only(), py::arg("oidn_library") = py::none(), doc("Renderer.__init__"))
      .def_property_readonly("device", &Renderer::device)
      .def_property_readonly(
          "summary",
          [](Renderer& r) {
            kuafu_render_summary s = kuafu_render_summary_init();
            check<Kuafu>(kuafu_renderer_get_summary(r.get(), &s));
            return s;
          },
          doc("Renderer.summary"))
      .def_property_readonly(
          "stage_times",
          [](Renderer& r) {
            return stage_times<Kuafu>([&](ks_stage_time* t, uint32_t* n) { return kuafu_renderer_get_stage_times(r.get(), t, n); });
          },
          doc("Renderer.stage_times"));
  def_render(
      renderer, "render",
      [](const py::object& self, Scene& scene, const Call& call, const kuafu_render_desc& desc) {
        return self.cast<Renderer&>().render(scene, call, desc);
      },
      doc("Renderer.render"));
  def_render(
      renderer, "submit",
      [](const py::object& self, Scene& scene, const Call& call, const kuafu_render_desc& desc) {
        const auto [sync, arrays] = self.cast<Renderer&>().submit(scene, call, desc);
        return Submission{self, sync, arrays};
      },
      doc("Renderer.submit"));
  renderer.def(
      "light_gbuffers",
      [](Renderer& r, Scene& scene, const py::object& cameras, const py::object& outputs, const py::dict& left, const py::object& right,
         const py::object& projector_depth, const std::string& depth_kind, const py::object& laser_power,
         const py::object& ambient_radiance, const py::object& optics, uint32_t environment_count, float pixel_blur_px,
         uint32_t supersampling) {
        const Call call{cameras, outputs, "infrared", std::nullopt, optics, py::none(), {}, py::none()};
        return r.light_gbuffers(scene, call, left, right, projector_depth, depth_kind, laser_power, ambient_radiance, environment_count,
                                pixel_blur_px, supersampling);
      },
      py::arg("scene"), py::arg("cameras"), py::arg("outputs"), py::kw_only(), py::arg("left"), py::arg("right") = py::none(),
      py::arg("projector_depth") = py::none(), py::arg("depth_kind") = "planar", py::arg("laser_power") = py::none(),
      py::arg("ambient_radiance") = py::none(), py::arg("optics") = py::none(), py::arg("environment_count") = 1,
      py::arg("pixel_blur_px") = 0.0f, py::arg("supersampling") = 1, doc("Renderer.light_gbuffers"));
  renderer.def("cancel", &Renderer::cancel, doc("Renderer.cancel"));
}

}  // namespace ks_python
