// simsense_parameters and simsense_signal by field name.
#pragma once

#include <variant>

#include "simsense_api.h"

namespace ks_python {

template <class Struct>
struct Field {
  const char* name;
  std::variant<float Struct::*, uint32_t Struct::*, int32_t Struct::*, uint64_t Struct::*> member;
};

inline constexpr Field<simsense_parameters> parameter_fields[] = {{"noise_seed", &simsense_parameters::noise_seed},
                                                                  {"frame_index", &simsense_parameters::frame_index},
                                                                  {"census_width", &simsense_parameters::census_width},
                                                                  {"census_height", &simsense_parameters::census_height},
                                                                  {"max_disparity", &simsense_parameters::max_disparity},
                                                                  {"block_width", &simsense_parameters::block_width},
                                                                  {"block_height", &simsense_parameters::block_height},
                                                                  {"p1", &simsense_parameters::p1},
                                                                  {"p2", &simsense_parameters::p2},
                                                                  {"uniqueness_ratio", &simsense_parameters::uniqueness_ratio},
                                                                  {"lr_max_diff", &simsense_parameters::lr_max_diff},
                                                                  {"median_size", &simsense_parameters::median_size},
                                                                  {"subpixel", &simsense_parameters::subpixel},
                                                                  {"min_depth_m", &simsense_parameters::min_depth_m},
                                                                  {"max_depth_m", &simsense_parameters::max_depth_m},
                                                                  {"depth_dilation", &simsense_parameters::depth_dilation},
                                                                  {"census_kind", &simsense_parameters::census_kind},
                                                                  {"min_disparity", &simsense_parameters::min_disparity},
                                                                  {"path_count", &simsense_parameters::path_count},
                                                                  {"p2_full_gradient_dn", &simsense_parameters::p2_full_gradient_dn},
                                                                  {"speckle_max_size", &simsense_parameters::speckle_max_size},
                                                                  {"speckle_max_diff_px", &simsense_parameters::speckle_max_diff_px},
                                                                  {"hole_filling", &simsense_parameters::hole_filling},
                                                                  {"low_texture_dn", &simsense_parameters::low_texture_dn},
                                                                  {"roi_x", &simsense_parameters::roi_x},
                                                                  {"roi_y", &simsense_parameters::roi_y},
                                                                  {"roi_width", &simsense_parameters::roi_width},
                                                                  {"roi_height", &simsense_parameters::roi_height},
                                                                  {"splat_size", &simsense_parameters::splat_size},
                                                                  {"census_contrast", &simsense_parameters::census_contrast}};

inline constexpr Field<simsense_signal> signal_fields[] = {{"exposure_s", &simsense_signal::exposure_s},
                                                           {"responsivity_e", &simsense_signal::responsivity_e},
                                                           {"speckle_shape", &simsense_signal::speckle_shape},
                                                           {"speckle_scale", &simsense_signal::speckle_scale},
                                                           {"speckle_correlation", &simsense_signal::speckle_correlation},
                                                           {"speckle_psf_sigma_px", &simsense_signal::speckle_psf_sigma_px},
                                                           {"prnu", &simsense_signal::prnu},
                                                           {"dark_current_e_per_s", &simsense_signal::dark_current_e_per_s},
                                                           {"hot_pixel_share", &simsense_signal::hot_pixel_share},
                                                           {"hot_pixel_e_per_s", &simsense_signal::hot_pixel_e_per_s},
                                                           {"temperature_c", &simsense_signal::temperature_c},
                                                           {"dark_reference_c", &simsense_signal::dark_reference_c},
                                                           {"dark_doubling_k", &simsense_signal::dark_doubling_k},
                                                           {"shot_noise", &simsense_signal::shot_noise},
                                                           {"full_well_e", &simsense_signal::full_well_e},
                                                           {"blooming", &simsense_signal::blooming},
                                                           {"dsnu_e", &simsense_signal::dsnu_e},
                                                           {"row_fixed_e", &simsense_signal::row_fixed_e},
                                                           {"column_fixed_e", &simsense_signal::column_fixed_e},
                                                           {"row_noise_e", &simsense_signal::row_noise_e},
                                                           {"column_noise_e", &simsense_signal::column_noise_e},
                                                           {"read_noise_e", &simsense_signal::read_noise_e},
                                                           {"conversion_gain_dn_per_e", &simsense_signal::conversion_gain_dn_per_e},
                                                           {"gain", &simsense_signal::gain},
                                                           {"response_exponent", &simsense_signal::response_exponent},
                                                           {"adc_noise_dn", &simsense_signal::adc_noise_dn},
                                                           {"black_level_dn", &simsense_signal::black_level_dn},
                                                           {"black_level_dn_per_k", &simsense_signal::black_level_dn_per_k},
                                                           {"bit_depth", &simsense_signal::bit_depth},
                                                           {"first_view", &simsense_signal::first_view},
                                                           {"scene_index", &simsense_signal::scene_index}};

/// Parameters that choose one of several ways, which may be given by name.
struct Choice {
  const char* field;
  std::vector<const char*> names;  // of 0, 1, ...
};
inline const std::vector<Choice> choices = {{"census_kind", {"center_symmetric", "plain"}},
                                            {"subpixel", {"none", "parabola", "equiangular", "equiangular_summed"}},
                                            {"hole_filling", {"keep", "left", "background"}}};

/// The number of a choice that is given by name; any other value as it is.
inline py::object chosen(const std::string& field, const py::handle& value) {
  const auto choice = std::find_if(choices.begin(), choices.end(), [&](const Choice& c) { return field == c.field; });
  if (choice == choices.end() || !py::isinstance<py::str>(value)) return py::reinterpret_borrow<py::object>(value);
  const auto name = py::cast<std::string>(value);
  std::string known;
  for (size_t i = 0; i < choice->names.size(); ++i) {
    if (name == choice->names[i]) return py::int_(i);
    known += (known.empty() ? "" : ", ") + std::string(choice->names[i]);
  }
  raise_argument<Simsense>(field + " is '" + name + "' (known: " + known + ")");
}

/// Whether there is such a field; it is set then.
template <class Struct, size_t count>
bool set_field(Struct& record, const Field<Struct> (&fields)[count], const std::string& name, const py::handle& value) {
  const auto field = std::find_if(std::begin(fields), std::end(fields), [&](const Field<Struct>& f) { return name == f.name; });
  if (field == std::end(fields)) return false;
  try {
    const py::object number = chosen(name, value);
    std::visit([&](auto member) { record.*member = py::cast<std::decay_t<decltype(record.*member)>>(number); }, field->member);
  } catch (const py::cast_error&) {
    raise_argument<Simsense>(name + " cannot be " + std::string(py::repr(value)));
  }
  return true;
}

template <class Struct, size_t count>
void get_fields(const Struct& record, const Field<Struct> (&fields)[count], py::dict& out) {
  for (const Field<Struct>& field : fields) std::visit([&](auto member) { out[field.name] = record.*member; }, field.member);
}

inline void set_signal(simsense_signal& signal, const py::object& changes, const char* eye) {
  if (!py::isinstance<py::dict>(changes))
    raise_argument<Simsense>(std::string(eye) + " must be a dict of parameters, not " + std::string(py::repr(changes)));
  for (const auto& [key, value] : py::reinterpret_borrow<py::dict>(changes)) {
    const std::string name = py::str(key);
    if (!set_field(signal, signal_fields, name, value))
      throw py::type_error("an imager has no parameter '" + name + "'; see simsense_signal");
  }
}

inline py::dict get_signal(const simsense_signal& signal) {
  py::dict out;
  get_fields(signal, signal_fields, out);
  return out;
}

inline simsense_signal signal_preset(const std::string& name) {
  simsense_signal signal = simsense_signal_init();
  check<Simsense>(simsense_signal_preset(name.c_str(), &signal));
  return signal;
}

/// All that an engine can be told between frames.
struct Settings {
  simsense_parameters parameters = simsense_parameters_init();
  simsense_signal left = simsense_signal_init(), right = simsense_signal_init();

  /// A signal's name means both eyes.
  void change(const py::kwargs& changes) {
    for (const auto& [key, value] : changes) {
      const std::string name = py::str(key);
      if (set_field(parameters, parameter_fields, name, value)) continue;
      if (!set_field(left, signal_fields, name, value))
        throw py::type_error("simsense has no parameter '" + name + "'; see help(simsense.Engine)");
      set_field(right, signal_fields, name, value);
    }
  }
};

}  // namespace ks_python
