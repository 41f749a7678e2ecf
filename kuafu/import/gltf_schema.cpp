// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_schema.h"

#include <algorithm>
#include <span>
#include <utility>

#include "device/error.h"

namespace kuafu {
namespace {

using nlohmann::json;

struct Row {
  const char* place;
  const char* members;  // each with its kind, where kuafu reads it; at the end "..." where there may be others
};

// The glTF 2.0 specification, section 5, and the extensions that are read. Every object may have extensions and extras besides.
constexpr Row rows[] = {
    {"",
     "accessors animations asset buffers bufferViews cameras extensionsRequired extensionsUsed images materials meshes nodes samplers "
     "scene scenes skins textures"},
    {"/accessors/*", "bufferView:index byteOffset:size componentType:index count:size max min name normalized:flag sparse type:text"},
    {"/accessors/*/sparse", "count:index indices values"},
    {"/accessors/*/sparse/indices", "bufferView:index byteOffset:index ..."},
    {"/accessors/*/sparse/values", "bufferView:index byteOffset:index ..."},
    {"/animations/*", "channels:array name:text samplers:array"},
    {"/animations/*/channels/*", "sampler:index target"},
    {"/animations/*/channels/*/target", "node:index path:text"},
    {"/animations/*/samplers/*", "input:index interpolation:text output:index"},
    {"/bufferViews/*", "buffer:index byteLength:size byteOffset:size byteStride:size name target"},
    {"/bufferViews/*/extensions/EXT_meshopt_compression",
     "buffer:index byteOffset:size byteLength:size byteStride:size count:size mode:text filter:text ..."},
    {"/buffers/*", "byteLength:size name uri:text"},
    {"/buffers/*/extensions/EXT_meshopt_compression", "fallback:flag ..."},
    {"/cameras/*", "name orthographic perspective type:text"},
    {"/cameras/*/perspective", "aspectRatio:number yfov:number zfar:number znear:number"},
    {"/extensions/KHR_lights_punctual/lights/*", "color:number[3] intensity:number name range:number spot type:text"},
    {"/extensions/KHR_lights_punctual/lights/*/extras", "ir_intensity:number ir_share:number radius_m:number size_m:number[2] ..."},
    {"/extensions/KHR_lights_punctual/lights/*/spot", "innerConeAngle outerConeAngle"},
    {"/images/*", "bufferView:index mimeType name uri:text"},
    {"/materials/*",
     "alphaCutoff:number alphaMode:text doubleSided emissiveFactor:number[3] emissiveTexture:texture name:text normalTexture:texture "
     "occlusionTexture pbrMetallicRoughness"},
    {"/materials/*/emissiveTexture", "index texCoord"},
#include "import/material_extras.inc"
    {"/materials/*/normalTexture", "index scale:number texCoord"},
    {"/materials/*/pbrMetallicRoughness",
     "baseColorFactor:number[4] baseColorTexture:texture metallicFactor:number metallicRoughnessTexture:texture roughnessFactor:number"},
    {"/materials/*/pbrMetallicRoughness/baseColorTexture", "index texCoord"},
    {"/materials/*/pbrMetallicRoughness/metallicRoughnessTexture", "index texCoord"},
    {"/materials/*/extensions/KHR_materials_anisotropy",
     "anisotropyStrength:number anisotropyRotation:number anisotropyTexture:texture ..."},
    {"/materials/*/extensions/KHR_materials_clearcoat",
     "clearcoatFactor:number clearcoatTexture:texture clearcoatRoughnessFactor:number clearcoatRoughnessTexture:texture "
     "clearcoatNormalTexture:texture ..."},
    {"/materials/*/extensions/KHR_materials_clearcoat/clearcoatNormalTexture", "scale:number ..."},
    {"/materials/*/extensions/KHR_materials_diffuse_transmission",
     "diffuseTransmissionFactor:number diffuseTransmissionTexture:texture diffuseTransmissionColorFactor:number[3] "
     "diffuseTransmissionColorTexture:texture ..."},
    {"/materials/*/extensions/KHR_materials_dispersion", "dispersion:number ..."},
    {"/materials/*/extensions/KHR_materials_emissive_strength", "emissiveStrength:number ..."},
    {"/materials/*/extensions/KHR_materials_ior", "ior:number ..."},
    {"/materials/*/extensions/KHR_materials_iridescence",
     "iridescenceFactor:number iridescenceTexture:texture iridescenceIor:number iridescenceThicknessMinimum:number "
     "iridescenceThicknessMaximum:number iridescenceThicknessTexture:texture ..."},
    {"/materials/*/extensions/KHR_materials_sheen",
     "sheenColorFactor:number[3] sheenColorTexture:texture sheenRoughnessFactor:number sheenRoughnessTexture:texture ..."},
    {"/materials/*/extensions/KHR_materials_specular", "specularFactor:number specularTexture:texture specularColorFactor:number[3] ..."},
    {"/materials/*/extensions/KHR_materials_transmission", "transmissionFactor:number transmissionTexture:texture ..."},
    {"/materials/*/extensions/KHR_materials_volume", "thicknessFactor:number attenuationDistance:number attenuationColor:number[3] ..."},
    {"/meshes/*", "name:text primitives:array weights:number[]"},
    {"/meshes/*/primitives/*", "attributes:object indices:index material:index mode:index targets"},
    {"/meshes/*/primitives/*/extensions/KHR_draco_mesh_compression", "bufferView:index attributes:object ..."},
    {"/nodes/*",
     "camera:index children:index[] matrix:number[16] mesh:index name:text rotation:number[4] scale:number[3] skin:index "
     "translation:number[3] weights:number[]"},
    {"/nodes/*/extensions/EXT_mesh_gpu_instancing/attributes", "TRANSLATION:index ROTATION:index SCALE:index ..."},
    {"/nodes/*/extensions/KHR_lights_punctual", "light:index ..."},
    {"/samplers/*", "magFilter:index minFilter:index name wrapS:index wrapT:index"},
    {"/scenes/*", "name nodes:index[]"},
    {"/skins/*", "inverseBindMatrices:index joints:index[] name skeleton"},
    {"/textures/*", "name sampler:index source:index"},
    {"/textures/*/extensions/EXT_texture_webp", "source:index ..."},
};

// Members of each member of the kind "texture".
constexpr Row texture_rows[] = {
    {"", "index:index texCoord:index ..."},
    {"/extensions/KHR_texture_transform", "offset:number[2] scale:number[2] rotation:number texCoord:index ..."},
};

std::vector<std::string_view> words(std::string_view text, char between) {
  std::vector<std::string_view> out;
  while (!text.empty()) {
    const size_t end = std::min(text.find(between), text.size());
    out.push_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

GltfObject object_of(const Row& row) {
  GltfObject out{row.place, {}};
  for (const std::string_view word : words(row.members, ' ')) {
    const size_t colon = std::min(word.find(':'), word.size());
    if (word == "...")
      out.is_open = true;
    else
      out.members.push_back({word.substr(0, colon), word.substr(std::min(colon + 1, word.size()))});
  }
  return out;
}

// tinygltf keeps indices in an int and counts of bytes in a size_t; what does not fit would wrap around in silence.
bool is_below(const json& value, uint64_t limit) { return value.is_number_unsigned() && value.get<uint64_t>() < limit; }
bool is_index(const json& value) { return is_below(value, uint64_t{1} << 31); }

/// "number[3]" as {"number", "3"}.
std::pair<std::string_view, std::string_view> parts_of(std::string_view kind) {
  const size_t open = kind.find('[');
  return {kind.substr(0, open), kind.substr(open + 1, kind.size() - open - 2)};
}

bool matches(const json& value, std::string_view kind) {
  if (kind.ends_with(']')) {
    const auto [one, count] = parts_of(kind);
    return value.is_array() && std::all_of(value.begin(), value.end(), [&](const json& v) { return matches(v, one); }) &&
           (count.empty() || std::to_string(value.size()) == count);
  }
  if (kind == "number") return value.is_number();
  if (kind == "index") return is_index(value);
  if (kind == "size") return is_below(value, uint64_t{1} << 48);
  if (kind == "text") return value.is_string();
  if (kind == "flag") return value.is_boolean();
  return kind == "array" ? value.is_array() : value.is_object();
}

std::string expected(std::string_view kind) {
  if (kind.ends_with(']')) {
    const auto [one, count] = parts_of(kind);
    const std::string many = one == "number" ? "numbers" : "non-negative integers below 2^31";
    return (count.empty() ? "an array of " : std::string(count) + " ") + many;
  }
  if (kind == "index") return "a non-negative integer below 2^31";
  if (kind == "size") return "a non-negative integer below 2^48";
  if (kind == "text") return "a string";
  if (kind == "flag") return "true or false";
  if (kind == "number") return "a number";
  return kind == "array" ? "an array" : "an object";
}

/// Calls visit(object, name) for what stands at the place below `value`.
template <class Visit>
void descend(const json& value, std::span<const std::string_view> place, const std::string& name, const Visit& visit) {
  if (!place.empty() && place[0] == "*") {
    if (!value.is_array()) ks::fail(KS_ERROR_FILE, "%s is not an array", name.c_str());
    for (size_t i = 0; i < value.size(); ++i) descend(value[i], place.subspan(1), name + "[" + std::to_string(i) + "]", visit);
    return;
  }
  if (!value.is_object()) ks::fail(KS_ERROR_FILE, "%s is not an object", name.c_str());
  if (place.empty()) return visit(value, name);
  const auto member = value.find(place[0]);
  if (member == value.end() || (place[0] == "extras" && !member->is_object())) return;  // extras may be anything
  descend(*member, place.subspan(1), (name.empty() ? "" : name + "/") + std::string(place[0]), visit);
}

template <class Visit>
void visit_rows(const json& root, std::span<const Row> table, const std::string& name, const Visit& visit) {
  for (const Row& row : table) {
    const GltfObject object = object_of(row);
    const std::string_view place = object.place;
    descend(root, words(place.substr(std::min<size_t>(1, place.size())), '/'), name,
            [&](const json& value, const std::string& what) { visit(object, value, what); });
  }
}

void check_members(const GltfObject& object, const json& value, const std::string& name) {
  for (const auto& [member, kind] : object.members) {
    const auto found = value.find(member);
    if (kind.empty() || found == value.end()) continue;
    const std::string what = (name.empty() ? "" : name + "/") + std::string(member);
    if (kind == "texture") {
      visit_rows(*found, texture_rows, what, check_members);
    } else if (!matches(*found, kind)) {
      ks::fail(KS_ERROR_FILE, "%s is %.60s, must be %s", what.c_str(), found->dump(-1, ' ', true, json::error_handler_t::replace).c_str(),
               expected(kind).c_str());
    }
  }
}

void check_accessors(const json& attributes, const std::string& name) {
  if (!attributes.is_object()) ks::fail(KS_ERROR_FILE, "%s is not an object", name.c_str());
  for (const auto& [key, accessor] : attributes.items())
    if (!is_index(accessor)) ks::fail(KS_ERROR_FILE, "%s/%.40s must be an accessor's index", name.c_str(), key.c_str());
}

void check_primitives(const json& root) {
  constexpr std::string_view place[] = {"meshes", "*", "primitives", "*"};
  descend(root, place, "", [](const json& primitive, const std::string& name) {
    if (!primitive.contains("attributes")) ks::fail(KS_ERROR_FILE, "%s/attributes is missing", name.c_str());
    check_accessors(primitive["attributes"], name + "/attributes");
    constexpr std::string_view targets[] = {"targets", "*"};
    descend(primitive, targets, name, check_accessors);
  });
}

/// Every buffer view lies inside its buffer.
void check_views(const json& root) {
  const json none = json::array();
  const json& buffers = root.contains("buffers") ? root["buffers"] : none;
  constexpr std::string_view place[] = {"bufferViews", "*"};
  descend(root, place, "", [&](const json& view, const std::string& name) {
    if (!view.contains("buffer") || !view.contains("byteLength"))
      ks::fail(KS_ERROR_FILE, "%s has no buffer or no byteLength", name.c_str());
    const uint64_t buffer = view["buffer"], offset = view.value("byteOffset", uint64_t{0}), length = view["byteLength"];
    if (buffer >= buffers.size())
      ks::fail(KS_ERROR_FILE, "%s/buffer is %zu, there are %zu buffers", name.c_str(), size_t{buffer}, buffers.size());
    const uint64_t size = buffers[buffer].value("byteLength", uint64_t{0});
    if (offset > size || length > size - offset)
      ks::fail(KS_ERROR_FILE, "%s: bytes %zu + %zu end beyond buffer %zu of %zu bytes", name.c_str(), size_t{offset}, size_t{length},
               size_t{buffer}, size_t{size});
  });
}

/// Bounds recursion over the parsed tree, in tinygltf and in destructors.
void check_depth(std::string_view text) {
  constexpr int limit = 128;
  int depth = 0;
  bool quoted = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\') ++i;
      quoted = c != '"';
    } else if (c == '"') {
      quoted = true;
    } else if (c == '{' || c == '[') {
      if (++depth > limit) ks::fail(KS_ERROR_FILE, "the JSON is nested deeper than %d at byte %zu", limit, i);
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
}

}  // namespace

json parse_gltf_json(std::string_view text) {
  check_depth(text);
  json root;
  try {
    root = json::parse(text);
  } catch (const json::exception& error) {
    ks::fail(KS_ERROR_FILE, "this is not JSON: %s", error.what());
  }
  if (!root.is_object()) ks::fail(KS_ERROR_FILE, "the JSON's root is not an object");
  const json::json_pointer version("/asset/version");
  if (!root.contains(version) || !root.at(version).is_string())
    ks::fail(KS_ERROR_FILE, "asset.version is missing: this is not a glTF file");
  const std::string number = root.at(version).get<std::string>();
  if (number.rfind("2.", 0) != 0) ks::fail(KS_ERROR_UNSUPPORTED, "asset.version is '%.20s', only glTF 2.x is read", number.c_str());
  visit_gltf_objects(root, check_members);
  check_primitives(root);
  check_views(root);
  return root;
}

void visit_gltf_objects(const json& root, const std::function<void(const GltfObject&, const json&, const std::string&)>& visit) {
  visit_rows(root, rows, "", visit);
}

}  // namespace kuafu
