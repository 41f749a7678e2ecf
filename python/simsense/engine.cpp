// SPDX-License-Identifier: Apache-2.0
// Engine and Camera: a rig and named parameters in, disparity and depth arrays out.
#include "bindings/array_pool.h"
#include "bindings/lens.h"
#include "bindings/wait.h"
#include "ks/lens.hpp"
#include "settings.h"

namespace ks_python {
namespace {

struct Output {
  const char* name;
  uint32_t output;
  uint32_t format;
  bool rgb_size;  // of the RGB camera's size, else of the IR cameras'
  bool points;    // three or six floats a pixel, RGB size where there is an RGB camera
};
constexpr Output outputs_known[] = {{"disparity", SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32, false, false},
                                    {"depth", SIMSENSE_OUTPUT_DEPTH, KS_FORMAT_F32, false, false},
                                    {"depth_rgb", SIMSENSE_OUTPUT_DEPTH_RGB, KS_FORMAT_F32, true, false},
                                    {"ir_left", SIMSENSE_OUTPUT_IR_LEFT, KS_FORMAT_U8, false, false},
                                    {"ir_right", SIMSENSE_OUTPUT_IR_RIGHT, KS_FORMAT_U8, false, false},
                                    {"rectified_left", SIMSENSE_OUTPUT_RECTIFIED_LEFT, KS_FORMAT_U8, false, false},
                                    {"rectified_right", SIMSENSE_OUTPUT_RECTIFIED_RIGHT, KS_FORMAT_U8, false, false},
                                    {"points", SIMSENSE_OUTPUT_POINTS, KS_FORMAT_F32, false, true},
                                    {"confidence", SIMSENSE_OUTPUT_CONFIDENCE, KS_FORMAT_F32, false, false},
                                    {"reason", SIMSENSE_OUTPUT_REASON, KS_FORMAT_U8, false, false},
                                    {"points_colored", SIMSENSE_OUTPUT_POINTS_COLORED, KS_FORMAT_F32, true, true}};

/// Numpy memory as an image argument. `keep` holds what must live through the call: a copy where C cannot read the array as it is.
simsense_image host_image(py::array array, uint32_t batch_count, const char* what, bool color, std::vector<py::object>& keep) {
  const py::ssize_t dimensions = color ? 3 : 2;
  if (array.ndim() != dimensions && array.ndim() != dimensions + 1)
    raise_argument<Simsense>(std::string(what) + (color ? " must be [height, width, 3] or [batch, height, width, 3]"
                                                        : " must be [height, width] or [batch, height, width]"));
  if (array.ndim() == dimensions && batch_count != 1)
    raise_argument<Simsense>(std::string(what) + " needs a leading dimension of " + std::to_string(batch_count));
  bool plain = (array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_) != 0;
  for (py::ssize_t k = 0; k < array.ndim(); ++k) plain = plain && (array.strides(k) != 0 || array.shape(k) == 1);
  if (!plain) array = py::array::ensure(array.attr("copy")(), py::array::c_style);
  simsense_image image = {};
  image.host = const_cast<void*>(array.data());
  image.image = ks_image_desc_packed(format_of<Simsense>(array.dtype()), 0, nullptr);
  image.image.dim_count = static_cast<uint32_t>(array.ndim());
  for (py::ssize_t k = 0; k < array.ndim(); ++k) {
    image.image.shape[k] = static_cast<uint64_t>(array.shape(k));
    image.image.byte_stride[k] = array.strides(k);
  }
  keep.push_back(std::move(array));
  return image;
}

py::array_t<float> analogue(const py::object& signal, const py::array_t<float, py::array::c_style | py::array::forcecast>& light,
                            uint64_t seed, uint64_t frame_index, uint32_t side) {
  if (light.ndim() != 2) raise_argument<Simsense>("light must be [height, width]");
  simsense_signal known = simsense_signal_init();
  set_signal(known, signal, "signal");
  py::array_t<float> dn({light.shape(0), light.shape(1)});
  check<Simsense>(simsense_signal_analogue(&known, light.data(), static_cast<uint32_t>(light.shape(1)),
                                           static_cast<uint32_t>(light.shape(0)), seed, frame_index, side, dn.mutable_data()));
  return dn;
}

class Engine {
 public:
  Engine(const py::object& device, const py::object& left, const py::object& right, const py::object& left_to_right, const py::object& rgb,
         const py::object& left_to_rgb, const py::kwargs& options) {
    if (!py::isinstance<Device<Simsense>>(device))
      raise_argument<Simsense>("device must be a simsense.Device, not " + std::string(py::repr(device)));
    device_ = py::cast<std::shared_ptr<Device<Simsense>>>(device);
    rig_.left = read_as<Simsense, simsense_camera>(left, "left", "a simsense.Camera");
    rig_.right = read_as<Simsense, simsense_camera>(right, "right", "a simsense.Camera");
    if (!rgb.is_none()) rig_.rgb = read_as<Simsense, simsense_camera>(rgb, "rgb", "a simsense.Camera or None");
    read_required_matrix<Simsense>(left_to_right, "left_to_right", rig_.left_to_right, 16);
    read_matrix<Simsense>(left_to_rgb, "left_to_rgb", rig_.left_to_rgb, 16);
    Settings settings;
    for (const auto& [key, value] : options)
      if (const std::string name = py::str(key); !set_field<Simsense>(rig_, rig_fields, name, value)) settings.change(name, value);
    check<Simsense>(simsense_engine_create(device_->get(), &rig_, &settings.parameters, handle_.put()));
    check<Simsense>(simsense_engine_set_signal(get(), &settings.left, &settings.right));
  }

  [[nodiscard]] simsense_engine get() const { return handle_.get(); }
  [[nodiscard]] const std::shared_ptr<Device<Simsense>>& device() const { return device_; }

  [[nodiscard]] Settings settings() const {
    Settings s;
    check<Simsense>(simsense_engine_get_parameters(get(), &s.parameters));
    check<Simsense>(simsense_engine_get_signal(get(), &s.left, &s.right));
    return s;
  }
  /// All of the changes or none.
  void set_parameters(const py::kwargs& changes) {
    const Settings old = settings();
    Settings s = old;
    for (const auto& [key, value] : changes) s.change(py::str(key), value);
    check<Simsense>(simsense_engine_set_signal(get(), &s.left, &s.right));
    try {
      check<Simsense>(simsense_engine_set_parameters(get(), &s.parameters));
    } catch (const py::error_already_set&) {
      simsense_engine_set_signal(get(), &old.left, &old.right);
      throw;
    }
  }
  void set_signal(const py::object& left, const py::object& right) {
    Settings s = settings();
    ks_python::set_signal(s.left, left, "left");
    ks_python::set_signal(s.right, right, "right");
    check<Simsense>(simsense_engine_set_signal(get(), &s.left, &s.right));
  }
  [[nodiscard]] py::dict parameters() const {
    const Settings s = settings();
    py::dict out;
    get_fields(s.parameters, parameter_fields, out);
    get_fields(s.left, signal_fields, out);
    return out;
  }
  [[nodiscard]] py::tuple signal() const {
    const Settings s = settings();
    return py::make_tuple(get_signal(s.left), get_signal(s.right));
  }

  py::dict stage_times() {
    return ks_python::stage_times<Simsense>([this](ks_stage_time* t, uint32_t* n) { return simsense_engine_get_stage_times(get(), t, n); });
  }

  [[nodiscard]] py::tuple rectified() const {
    double k[9], baseline_m = 0, left_to_rectified[16];
    check<Simsense>(simsense_engine_get_rectified(get(), k, &baseline_m, left_to_rectified));
    return py::make_tuple(matrix(k, 3, 3), baseline_m, matrix(left_to_rectified, 4, 4));
  }

  /// The inputs of a call; all but the first two may be None.
  struct Inputs {
    py::object left, right, left_laser, right_laser, rgb, noise_seeds;
  };

  py::dict compute(const Inputs& inputs, const py::object& outputs, const py::object& callback) {
    Call call = make_call(inputs, outputs);
    Progress(callback).check<Simsense>(call.desc, [&] { return simsense_engine_compute(get(), &call.desc); });
    return call.results;
  }

  /// The results are the caller's to read after wait().
  std::pair<ks_sync, py::dict> submit(const Inputs& inputs, const py::object& outputs) {
    const Call call = make_call(inputs, outputs);
    ks_sync sync = ks_sync_init();
    check_unlocked<Simsense>([&] { return simsense_engine_submit(get(), &call.desc, &sync); });
    return {sync, call.results};
  }

  /// false: it has not ended yet. Signals are heard while it waits.
  bool wait(const ks_sync& sync, double timeout_s) {
    return wait_in_slices<Simsense>(timeout_s, [&](uint64_t slice_ns) { return simsense_engine_wait_for(get(), &sync, slice_ns); });
  }

  void cancel() { check<Simsense>(simsense_engine_cancel(get())); }

 private:
  /// A compute call's arguments as C has them; `keep` holds what must live through it.
  struct Call {
    std::vector<py::object> keep;
    std::vector<simsense_output_desc> outputs;
    std::vector<uint64_t> noise_seeds;
    py::dict results;
    simsense_compute_desc desc = simsense_compute_desc_init();
  };
  Call make_call(const Inputs& inputs, const py::object& outputs) const {
    Call call;
    if (!inputs.rgb.is_none()) call.desc.rgb = input(inputs.rgb, "rgb", call.keep, true);
    call.desc.left = input(inputs.left, "left", call.keep);
    call.desc.right = input(inputs.right, "right", call.keep);
    if (!inputs.left_laser.is_none()) call.desc.left_laser = input(inputs.left_laser, "left_laser", call.keep);
    if (!inputs.right_laser.is_none()) call.desc.right_laser = input(inputs.right_laser, "right_laser", call.keep);
    if (!inputs.noise_seeds.is_none()) call.noise_seeds = py::cast<std::vector<uint64_t>>(inputs.noise_seeds);
    if (!call.noise_seeds.empty() && call.noise_seeds.size() != rig_.batch_count)
      raise_argument<Simsense>(std::to_string(call.noise_seeds.size()) + " noise_seeds for " + std::to_string(rig_.batch_count) + " pairs");
    call.desc.noise_seeds = call.noise_seeds.empty() ? nullptr : call.noise_seeds.data();
    read_outputs(outputs, call.desc.left.image.dim_count == 3, call.outputs, call.results, call.keep);
    call.desc.outputs = call.outputs.data();
    call.desc.output_count = static_cast<uint32_t>(call.outputs.size());
    return call;
  }

  simsense_image input(const py::object& value, const char* what, std::vector<py::object>& keep, bool color = false) const {
    if (py::isinstance<Image<Simsense>>(value)) return buffer_image(py::cast<Image<Simsense>>(value));
    if (!py::isinstance<py::array>(value)) raise_argument<Simsense>(std::string(what) + " must be a numpy array or a simsense.Image");
    return host_image(py::reinterpret_borrow<py::array>(value), rig_.batch_count, what, color, keep);
  }

  static simsense_image buffer_image(const Image<Simsense>& image) {
    simsense_image out = {};
    out.buffer = image.buffer->get();
    out.image = image.c;
    return out;
  }

  /// `outputs`: names (arrays are made), or {name: array or Image} to fill or {name: dtype} to make.
  void read_outputs(const py::object& outputs, bool batched, std::vector<simsense_output_desc>& c_outputs, py::dict& results,
                    std::vector<py::object>& keep) const {
    const bool given = py::isinstance<py::dict>(outputs);
    for (const std::string& name : read_names<Simsense>(outputs, "outputs")) {
      const Output& o = outputs_known[index_of_name<Simsense>(outputs_known, name, "output", &Output::name)];
      const py::str item(name);
      simsense_output_desc c = {};
      c.header = ks_header_make(SIMSENSE_TYPE_OUTPUT_DESC, sizeof c);
      c.output = o.output;
      py::object result = given ? py::object(outputs[item]) : py::none();
      const bool made = !given || !(py::isinstance<Image<Simsense>>(result) || py::isinstance<py::array>(result));
      if (made) result = ArrayPool::make(given ? py::dtype::from_args(result) : dtype_of(format_of_output(o)), shape_of(o));
      if (py::isinstance<Image<Simsense>>(result)) {
        c.image = buffer_image(py::cast<Image<Simsense>>(result));
      } else {
        c.image = target(py::reinterpret_borrow<py::array>(result), o, keep);
        if (made && !batched) result = result[py::int_(0)];
      }
      c_outputs.push_back(c);
      results[item] = result;
    }
  }

  [[nodiscard]] std::vector<py::ssize_t> shape_of(const Output& o) const {
    const bool rgb = o.rgb_size || (o.points && rig_.rgb.width > 0);
    const simsense_camera& size = rgb ? rig_.rgb : rig_.left;
    std::vector<py::ssize_t> shape = {rig_.batch_count, size.height, size.width};
    if (o.points) shape.push_back(o.output == SIMSENSE_OUTPUT_POINTS_COLORED ? 6 : 3);
    return shape;
  }

  /// An imager of more than 8 bits gives uint16; rectified, both images have the deeper one's.
  [[nodiscard]] uint32_t format_of_output(const Output& o) const {
    if (o.format != KS_FORMAT_U8 || o.output == SIMSENSE_OUTPUT_REASON) return o.format;
    const Settings s = settings();
    const uint32_t bits = o.output == SIMSENSE_OUTPUT_IR_LEFT    ? s.left.bit_depth
                          : o.output == SIMSENSE_OUTPUT_IR_RIGHT ? s.right.bit_depth
                                                                 : std::max(s.left.bit_depth, s.right.bit_depth);
    return bits > 8 ? KS_FORMAT_U16 : KS_FORMAT_U8;
  }

  simsense_image target(py::array array, const Output& o, std::vector<py::object>& keep) const {
    const std::vector<py::ssize_t> shape = shape_of(o);
    if (!array.writeable() || array.ndim() < 2) raise_argument<Simsense>(std::string("output '") + o.name + "' needs a writable array");
    const uint32_t format = format_of<Simsense>(array.dtype());
    std::vector<py::ssize_t> have(array.shape(), array.shape() + array.ndim()), strides(array.strides(), array.strides() + array.ndim());
    if (have.size() + 1 == shape.size() && shape[0] == 1) {
      have.insert(have.begin(), 1);
      strides.insert(strides.begin(), array.nbytes());
    }
    if (have != shape)
      raise_argument<Simsense>(std::string("output '") + o.name + "' needs shape " +
                               std::string(py::str(py::handle(py::tuple(py::cast(shape))))));
    simsense_image image = {};
    image.host = array.mutable_data();
    image.image = ks_image_desc_packed(format, static_cast<uint32_t>(shape.size()), reinterpret_cast<const uint64_t*>(shape.data()));
    std::copy(strides.begin(), strides.end(), image.image.byte_stride);
    keep.push_back(std::move(array));
    return image;
  }

  std::shared_ptr<Device<Simsense>> device_;
  simsense_rig_desc rig_ = simsense_rig_desc_init();
  Handle<simsense_engine, simsense_engine_release> handle_;
};

/// Work under way, and its results, which must live until it is done.
struct Submission {
  py::object engine;
  ks_sync sync;
  py::dict results;

  [[nodiscard]] py::dict wait(std::optional<double> timeout_s) const {
    if (!engine.cast<Engine&>().wait(sync, seconds_to_wait<Simsense>(timeout_s)))
      raise<Simsense>(KS_ERROR_TIMEOUT, PyExc_TimeoutError, "the submission has not ended; it goes on");
    return results;
  }
};

void bind_camera(py::module_& module) {
  using C = simsense_camera;
  py::class_<C>(module, "Camera", doc("Camera"))
      .def(py::init([](const py::object& width, const py::object& height, const py::object& k, const py::object& distortion,
                       const std::string& lens_model) {
             C camera = {};
             camera.width = read_as<Simsense, uint32_t>(width, "width", "a number of pixels");
             camera.height = read_as<Simsense, uint32_t>(height, "height", "a number of pixels");
             read_required_matrix<Simsense>(k, "k", camera.k, 9);
             camera.lens.model = read_lens_model<Simsense>(lens_model);
             if (!distortion.is_none())
               read_distortion<Simsense>(read_as<Simsense, std::vector<double>>(distortion, "distortion", "a sequence of numbers"),
                                         camera.lens);
             return camera;
           }),
           py::arg("width"), py::arg("height"), py::arg("k"), py::arg("distortion") = py::none(), py::arg("lens_model") = "brown_conrady")
      .def_readonly("width", &C::width)
      .def_readonly("height", &C::height)
      .def_property_readonly("k", [](const C& c) { return matrix(c.k, 3, 3); })
      .def_property_readonly("lens_model", [](const C& c) { return lens_models.at(c.lens.model); })
      .def_property_readonly("distortion", [](const C& c) { return py::tuple(py::cast(std::to_array(c.lens.distortion))); });
}

ks_lens read_lens(const std::vector<double>& distortion, const std::string& model) {
  ks_lens lens{read_lens_model<Simsense>(model), 0, {}};
  read_distortion<Simsense>(distortion, lens);
  return lens;
}

/// map(lens, x, y, radius from which on it goes straight) of each pair of two arrays of one shape.
template <auto map>
py::tuple mapped(const Doubles& x, const Doubles& y, const std::vector<double>& distortion, const std::string& model) {
  const std::vector<py::ssize_t> shape(x.shape(), x.shape() + x.ndim());
  if (!std::equal(shape.begin(), shape.end(), y.shape(), y.shape() + y.ndim())) raise_argument<Simsense>("x and y differ in their shape");
  const ks_lens lens = read_lens(distortion, model);
  const double last_radius2 = ks::lens_fold(lens).last_radius2;
  Doubles to_x(shape), to_y(shape);
  const double *from_x = x.data(), *from_y = y.data();
  double *out_x = to_x.mutable_data(), *out_y = to_y.mutable_data();
  for (py::ssize_t i = 0; i < x.size(); ++i) {
    const auto to = map(lens, from_x[i], from_y[i], last_radius2);
    out_x[i] = to.x;
    out_y[i] = to.y;
  }
  return py::make_tuple(to_x, to_y);
}

void bind_lens(py::module_& module) {
  const py::arg x("x"), y("y"), distortion("distortion");
  const py::arg_v model = py::arg("lens_model") = "brown_conrady";
  module.def("distort", &mapped<ks::distorted>, x, y, distortion, model, doc("distort"));
  constexpr auto inverse = [](const ks_lens& lens, double a, double b, double last2) { return ks::undistorted(lens, a, b, last2); };
  module.def("undistort", &mapped<inverse>, x, y, distortion, model, doc("undistort"));
  module.def(
      "fold_radius2",
      [](const std::vector<double>& distortion, const std::string& model) { return ks::lens_fold(read_lens(distortion, model)).radius2; },
      distortion, model, doc("fold_radius2"));
}

}  // namespace

void bind_engine(py::module_& module) {
  module.attr("FAULTS") = names_of(rig_fields, "faults");
  module.attr("REASONS") = py::tuple(py::cast(std::vector<std::string>(std::begin(reason_names), std::end(reason_names))));
  bind_camera(module);
  bind_lens(module);
  module.def(
      "default_parameters",
      [] {
        py::dict out;
        get_fields(simsense_parameters_init(), parameter_fields, out);
        return out;
      },
      doc("default_parameters"));
  module.def(
      "signal_preset",
      [](const py::object& name) {
        simsense_signal signal = simsense_signal_init();
        check<Simsense>(simsense_signal_preset(read_as<Simsense, std::string>(name, "name", "a preset's name").c_str(), &signal));
        return get_signal(signal);
      },
      py::arg("name"), doc("signal_preset"));
  module.def("signal_analogue", &analogue, py::arg("signal"), py::arg("light"), py::kw_only(), py::arg("seed") = 0,
             py::arg("frame_index") = 0, py::arg("side") = 0, doc("signal_analogue"));
  py::class_<Submission>(module, "Submission", doc("Submission"))
      .def("wait", &Submission::wait, py::arg("timeout_s") = py::none(), doc("Submission.wait"));
  py::class_<Engine>(module, "Engine", doc("Engine"))
      .def(py::init<const py::object&, const py::object&, const py::object&, const py::object&, const py::object&, const py::object&,
                    const py::kwargs&>(),
           py::arg("device"), py::arg("left"), py::arg("right"), py::arg("left_to_right"), py::kw_only(), py::arg("rgb") = py::none(),
           py::arg("left_to_rgb") = py::none(), doc("Engine.__init__"))
      .def_property_readonly("device", &Engine::device)
      .def_property_readonly("parameters", &Engine::parameters, doc("Engine.parameters"))
      .def("set_parameters", &Engine::set_parameters, doc("Engine.set_parameters"))
      .def_property_readonly("signal", &Engine::signal, doc("Engine.signal"))
      .def("set_signal", &Engine::set_signal, py::arg("left") = py::dict(), py::arg("right") = py::dict(), doc("Engine.set_signal"))
      .def_property_readonly("rectified", &Engine::rectified, doc("Engine.rectified"))
      .def(
          "compute",
          [](Engine& self, const py::object& left, const py::object& right, const py::object& outputs, const py::object& left_laser,
             const py::object& right_laser, const py::object& rgb, const py::object& noise_seeds, const py::object& progress) {
            return self.compute({left, right, left_laser, right_laser, rgb, noise_seeds}, outputs, progress);
          },
          py::arg("left"), py::arg("right"), py::arg("outputs") = py::make_tuple("depth"), py::kw_only(),
          py::arg("left_laser") = py::none(), py::arg("right_laser") = py::none(), py::arg("rgb") = py::none(),
          py::arg("noise_seeds") = py::none(), py::arg("progress") = py::none(), doc("Engine.compute"))
      .def(
          "submit",
          [](const py::object& self, const py::object& left, const py::object& right, const py::object& outputs,
             const py::object& left_laser, const py::object& right_laser, const py::object& rgb, const py::object& noise_seeds) {
            const auto [sync, results] = self.cast<Engine&>().submit({left, right, left_laser, right_laser, rgb, noise_seeds}, outputs);
            return Submission{self, sync, results};
          },
          py::arg("left"), py::arg("right"), py::arg("outputs"), py::kw_only(), py::arg("left_laser") = py::none(),
          py::arg("right_laser") = py::none(), py::arg("rgb") = py::none(), py::arg("noise_seeds") = py::none(), doc("Engine.submit"))
      .def("cancel", &Engine::cancel, doc("Engine.cancel"))
      .def_property_readonly("stage_times", &Engine::stage_times, doc("Engine.stage_times"));
}

}  // namespace ks_python
