// SPDX-License-Identifier: Apache-2.0
// tinygltf drops an optional field of a wrong type in silence. This check of the JSON text makes it an error that names the field.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace kuafu {

/// Throws KS_ERROR_FILE for text that is not JSON, is nested deeper than 128, is not glTF 2, or has a field of a wrong type or length.
nlohmann::json parse_gltf_json(std::string_view text);

/// A member of an object, and what it must be; "" where kuafu does not read it.
struct GltfMember {
  std::string_view name, kind;
};
/// An object of a glTF file: where it stands, as a JSON pointer in which * is every element of an array, and its members.
struct GltfObject {
  std::string_view place;
  std::vector<GltfMember> members;
  bool is_open = false;  // it may have others
};
/// Calls visit(object, its JSON, its name for messages) for each object of a known place. Throws KS_ERROR_FILE where something else stands.
void visit_gltf_objects(const nlohmann::json& root,
                        const std::function<void(const GltfObject&, const nlohmann::json&, const std::string&)>& visit);

}  // namespace kuafu
