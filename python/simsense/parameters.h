// simsense_parameters by field name.
#pragma once

#include <variant>

#include "simsense_api.h"

namespace ks_python {

using Member = std::variant<float simsense_parameters::*, uint32_t simsense_parameters::*, int32_t simsense_parameters::*,
                            uint64_t simsense_parameters::*>;
struct Field {
  const char* name;
  Member member;
};

inline constexpr Field parameter_fields[] = {{"gain", &simsense_parameters::gain},
                                             {"black_level_dn", &simsense_parameters::black_level_dn},
                                             {"speckle_shape", &simsense_parameters::speckle_shape},
                                             {"speckle_scale", &simsense_parameters::speckle_scale},
                                             {"gaussian_mu_dn", &simsense_parameters::gaussian_mu_dn},
                                             {"gaussian_sigma_dn", &simsense_parameters::gaussian_sigma_dn},
                                             {"noise_seed", &simsense_parameters::noise_seed},
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
                                             {"depth_dilation", &simsense_parameters::depth_dilation}};

inline void set_parameters(simsense_parameters& parameters, const py::kwargs& changes) {
  for (const auto& [key, value] : changes) {
    const std::string name = py::str(key);
    const Field* field =
        std::find_if(std::begin(parameter_fields), std::end(parameter_fields), [&](const Field& f) { return name == f.name; });
    if (field == std::end(parameter_fields)) throw py::type_error("simsense has no parameter '" + name + "'; see help(simsense.Engine)");
    try {
      std::visit([&, v = value](auto member) { parameters.*member = py::cast<std::decay_t<decltype(parameters.*member)>>(v); },
                 field->member);
    } catch (const py::cast_error&) {
      raise_argument<Simsense>(name + " cannot be " + std::string(py::repr(value)));
    }
  }
}

inline py::dict get_parameters(const simsense_parameters& parameters) {
  py::dict out;
  for (const Field& field : parameter_fields) std::visit([&](auto member) { out[field.name] = parameters.*member; }, field.member);
  return out;
}

}  // namespace ks_python
