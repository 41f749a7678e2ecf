// SPDX-License-Identifier: Apache-2.0
// tinygltf drops an optional field of a wrong type in silence. This check of the JSON text makes it an error that names the field.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "import/import.h"

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

/// Warns once of each member that glTF 2.0 does not know at its place, with the nearest known name: glTF allows such members, and one that
/// is misspelt would change the scene without a word. Extensions and extras may hold
/// anything. After ten names, one warning counts the rest.
void warn_of_unknown_members(Import& import, const nlohmann::json& root);

}  // namespace kuafu
