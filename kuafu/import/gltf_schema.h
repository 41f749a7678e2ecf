// SPDX-License-Identifier: Apache-2.0
// tinygltf drops an optional field of a wrong type in silence. This check of the JSON text makes it an error that names the field.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace kuafu {

/// Parses a file's JSON. Throws KS_ERROR_FILE if it is not JSON, nested deeper than 128, not glTF 2, or has a field of a wrong type or
/// length.
nlohmann::json parse_gltf_json(std::string_view text);

/// A member of an object and its required type; "" if kuafu does not read it.
struct GltfMember {
  std::string_view name, kind;
};
/// An object of a glTF file: its place, as a JSON pointer with * for every array element, and its members.
struct GltfObject {
  std::string_view place;
  std::vector<GltfMember> members;
  bool is_open = false;  // it may have others
};
/// Calls visit(object, its JSON, its name in messages) for each object at a known place. Throws KS_ERROR_FILE for another type there.
void visit_gltf_objects(const nlohmann::json& root,
                        const std::function<void(const GltfObject&, const nlohmann::json&, const std::string&)>& visit);

}  // namespace kuafu
