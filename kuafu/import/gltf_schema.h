// SPDX-License-Identifier: Apache-2.0
// tinygltf drops an optional field of a wrong type in silence. This check of the JSON text makes it an error that names the field.
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

namespace kuafu {

/// Throws KS_ERROR_FILE for text that is not JSON, is nested deeper than 128, is not glTF 2, or has a field of a wrong type or length.
nlohmann::json parse_gltf_json(std::string_view text);

}  // namespace kuafu
