// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_schema.h"

#include <algorithm>

#include "device/error.h"

namespace kuafu {
namespace {

using nlohmann::json;

enum class Kind { number, index, size, numbers, indices, text, boolean, object, array };

struct Field {
  const char* table;    // JSON pointer to an array in the root
  const char* pointer;  // from an element of it
  Kind kind;
  size_t length = 0;  // of numbers; 0 = any
};

// The fields that kuafu reads, by name as in the glTF 2.0 specification section 5.
constexpr Field fields[] = {
    {"/buffers", "/byteLength", Kind::size},
    {"/buffers", "/uri", Kind::text},
    {"/buffers", "/extensions/EXT_meshopt_compression/fallback", Kind::boolean},
    {"/bufferViews", "/extensions/EXT_meshopt_compression", Kind::object},
    {"/bufferViews", "/extensions/EXT_meshopt_compression/buffer", Kind::index},
    {"/bufferViews", "/extensions/EXT_meshopt_compression/byteOffset", Kind::size},
    {"/bufferViews", "/extensions/EXT_meshopt_compression/byteLength", Kind::size},
    {"/bufferViews", "/extensions/EXT_meshopt_compression/byteStride", Kind::size},
    {"/bufferViews", "/extensions/EXT_meshopt_compression/count", Kind::size},
    {"/bufferViews", "/extensions/EXT_meshopt_compression/mode", Kind::text},
    {"/bufferViews", "/extensions/EXT_meshopt_compression/filter", Kind::text},
    {"/bufferViews", "/buffer", Kind::index},
    {"/bufferViews", "/byteOffset", Kind::size},
    {"/bufferViews", "/byteLength", Kind::size},
    {"/bufferViews", "/byteStride", Kind::size},
    {"/accessors", "/bufferView", Kind::index},
    {"/accessors", "/byteOffset", Kind::size},
    {"/accessors", "/componentType", Kind::index},
    {"/accessors", "/count", Kind::size},
    {"/accessors", "/type", Kind::text},
    {"/accessors", "/normalized", Kind::boolean},
    {"/accessors", "/sparse", Kind::object},
    {"/accessors", "/sparse/count", Kind::index},
    {"/accessors", "/sparse/indices", Kind::object},
    {"/accessors", "/sparse/indices/bufferView", Kind::index},
    {"/accessors", "/sparse/indices/byteOffset", Kind::index},
    {"/accessors", "/sparse/values", Kind::object},
    {"/accessors", "/sparse/values/bufferView", Kind::index},
    {"/accessors", "/sparse/values/byteOffset", Kind::index},
    {"/meshes", "/name", Kind::text},
    {"/meshes", "/primitives", Kind::array},
    {"/meshes", "/weights", Kind::numbers},
    {"/skins", "/inverseBindMatrices", Kind::index},
    {"/skins", "/joints", Kind::indices},
    {"/animations", "/name", Kind::text},
    {"/animations", "/channels", Kind::array},
    {"/animations", "/samplers", Kind::array},
    {"/nodes", "/name", Kind::text},
    {"/nodes", "/mesh", Kind::index},
    {"/nodes", "/skin", Kind::index},
    {"/nodes", "/weights", Kind::numbers},
    {"/nodes", "/camera", Kind::index},
    {"/nodes", "/children", Kind::indices},
    {"/nodes", "/matrix", Kind::numbers, 16},
    {"/nodes", "/translation", Kind::numbers, 3},
    {"/nodes", "/rotation", Kind::numbers, 4},
    {"/nodes", "/scale", Kind::numbers, 3},
    {"/nodes", "/extensions", Kind::object},
    {"/nodes", "/extensions/KHR_lights_punctual/light", Kind::index},
    {"/nodes", "/extensions/EXT_mesh_gpu_instancing", Kind::object},
    {"/nodes", "/extensions/EXT_mesh_gpu_instancing/attributes", Kind::object},
    {"/nodes", "/extensions/EXT_mesh_gpu_instancing/attributes/TRANSLATION", Kind::index},
    {"/nodes", "/extensions/EXT_mesh_gpu_instancing/attributes/ROTATION", Kind::index},
    {"/nodes", "/extensions/EXT_mesh_gpu_instancing/attributes/SCALE", Kind::index},
    {"/scenes", "/nodes", Kind::indices},
    {"/materials", "/name", Kind::text},
    {"/materials", "/pbrMetallicRoughness", Kind::object},
    {"/materials", "/pbrMetallicRoughness/baseColorFactor", Kind::numbers, 4},
    {"/materials", "/pbrMetallicRoughness/metallicFactor", Kind::number},
    {"/materials", "/pbrMetallicRoughness/roughnessFactor", Kind::number},
    {"/materials", "/emissiveFactor", Kind::numbers, 3},
    {"/materials", "/normalTexture/scale", Kind::number},
    {"/materials", "/alphaMode", Kind::text},
    {"/materials", "/alphaCutoff", Kind::number},
    {"/materials", "/extensions", Kind::object},
    {"/materials", "/extensions/KHR_materials_ior", Kind::object},
    {"/materials", "/extensions/KHR_materials_ior/ior", Kind::number},
    {"/materials", "/extensions/KHR_materials_transmission", Kind::object},
    {"/materials", "/extensions/KHR_materials_transmission/transmissionFactor", Kind::number},
    {"/materials", "/extensions/KHR_materials_specular", Kind::object},
    {"/materials", "/extensions/KHR_materials_specular/specularFactor", Kind::number},
    {"/materials", "/extensions/KHR_materials_specular/specularColorFactor", Kind::numbers, 3},
    {"/materials", "/extensions/KHR_materials_volume", Kind::object},
    {"/materials", "/extensions/KHR_materials_volume/thicknessFactor", Kind::number},
    {"/materials", "/extensions/KHR_materials_volume/attenuationDistance", Kind::number},
    {"/materials", "/extensions/KHR_materials_volume/attenuationColor", Kind::numbers, 3},
    {"/materials", "/extensions/KHR_materials_emissive_strength", Kind::object},
    {"/materials", "/extensions/KHR_materials_emissive_strength/emissiveStrength", Kind::number},
    {"/materials", "/extensions/KHR_materials_clearcoat", Kind::object},
    {"/materials", "/extensions/KHR_materials_clearcoat/clearcoatFactor", Kind::number},
    {"/materials", "/extensions/KHR_materials_clearcoat/clearcoatRoughnessFactor", Kind::number},
    {"/materials", "/extensions/KHR_materials_clearcoat/clearcoatNormalTexture/scale", Kind::number},
    {"/materials", "/extensions/KHR_materials_diffuse_transmission", Kind::object},
    {"/materials", "/extensions/KHR_materials_diffuse_transmission/diffuseTransmissionFactor", Kind::number},
    {"/materials", "/extensions/KHR_materials_diffuse_transmission/diffuseTransmissionColorFactor", Kind::numbers, 3},
    {"/materials", "/extensions/KHR_materials_anisotropy", Kind::object},
    {"/materials", "/extensions/KHR_materials_anisotropy/anisotropyStrength", Kind::number},
    {"/materials", "/extensions/KHR_materials_anisotropy/anisotropyRotation", Kind::number},
    {"/materials", "/extensions/KHR_materials_sheen", Kind::object},
    {"/materials", "/extensions/KHR_materials_sheen/sheenColorFactor", Kind::numbers, 3},
    {"/materials", "/extensions/KHR_materials_sheen/sheenRoughnessFactor", Kind::number},
    {"/materials", "/extensions/KHR_materials_iridescence", Kind::object},
    {"/materials", "/extensions/KHR_materials_iridescence/iridescenceFactor", Kind::number},
    {"/materials", "/extensions/KHR_materials_iridescence/iridescenceIor", Kind::number},
    {"/materials", "/extensions/KHR_materials_iridescence/iridescenceThicknessMinimum", Kind::number},
    {"/materials", "/extensions/KHR_materials_iridescence/iridescenceThicknessMaximum", Kind::number},
    {"/materials", "/extensions/KHR_materials_dispersion", Kind::object},
    {"/materials", "/extensions/KHR_materials_dispersion/dispersion", Kind::number},
#include "import/material_extras.inc"
    {"/textures", "/source", Kind::index},
    {"/textures", "/sampler", Kind::index},
    {"/textures", "/extensions", Kind::object},
    {"/textures", "/extensions/EXT_texture_webp", Kind::object},
    {"/textures", "/extensions/EXT_texture_webp/source", Kind::index},
    {"/samplers", "/magFilter", Kind::index},
    {"/samplers", "/minFilter", Kind::index},
    {"/samplers", "/wrapS", Kind::index},
    {"/samplers", "/wrapT", Kind::index},
    {"/images", "/uri", Kind::text},
    {"/images", "/bufferView", Kind::index},
    {"/cameras", "/type", Kind::text},
    {"/cameras", "/perspective", Kind::object},
    {"/cameras", "/perspective/yfov", Kind::number},
    {"/cameras", "/perspective/aspectRatio", Kind::number},
    {"/cameras", "/perspective/znear", Kind::number},
    {"/cameras", "/perspective/zfar", Kind::number},
    {"/extensions/KHR_lights_punctual/lights", "/type", Kind::text},
    {"/extensions/KHR_lights_punctual/lights", "/color", Kind::numbers, 3},
    {"/extensions/KHR_lights_punctual/lights", "/intensity", Kind::number},
    {"/extensions/KHR_lights_punctual/lights", "/range", Kind::number},
};

// Textures of materials, each with the fields below it.
constexpr const char* texture_places[] = {
    "/pbrMetallicRoughness/baseColorTexture",
    "/pbrMetallicRoughness/metallicRoughnessTexture",
    "/normalTexture",
    "/emissiveTexture",
    "/extensions/KHR_materials_transmission/transmissionTexture",
    "/extensions/KHR_materials_specular/specularTexture",
    "/extensions/KHR_materials_clearcoat/clearcoatTexture",
    "/extensions/KHR_materials_clearcoat/clearcoatRoughnessTexture",
    "/extensions/KHR_materials_clearcoat/clearcoatNormalTexture",
    "/extensions/KHR_materials_diffuse_transmission/diffuseTransmissionTexture",
    "/extensions/KHR_materials_diffuse_transmission/diffuseTransmissionColorTexture",
    "/extensions/KHR_materials_anisotropy/anisotropyTexture",
    "/extensions/KHR_materials_sheen/sheenColorTexture",
    "/extensions/KHR_materials_sheen/sheenRoughnessTexture",
    "/extensions/KHR_materials_iridescence/iridescenceTexture",
    "/extensions/KHR_materials_iridescence/iridescenceThicknessTexture",
};

constexpr Field texture_fields[] = {
    {"", "/index", Kind::index},
    {"", "/texCoord", Kind::index},
    {"", "/extensions/KHR_texture_transform", Kind::object},
    {"", "/extensions/KHR_texture_transform/offset", Kind::numbers, 2},
    {"", "/extensions/KHR_texture_transform/scale", Kind::numbers, 2},
    {"", "/extensions/KHR_texture_transform/rotation", Kind::number},
    {"", "/extensions/KHR_texture_transform/texCoord", Kind::index},
};

// Of each element of meshes[].primitives.
constexpr Field primitive_fields[] = {
    {"", "/attributes", Kind::object},
    {"", "/indices", Kind::index},
    {"", "/material", Kind::index},
    {"", "/mode", Kind::index},
    {"", "/extensions", Kind::object},
    {"", "/extensions/KHR_draco_mesh_compression", Kind::object},
    {"", "/extensions/KHR_draco_mesh_compression/bufferView", Kind::index},
    {"", "/extensions/KHR_draco_mesh_compression/attributes", Kind::object},
};

constexpr Field channel_fields[] = {
    {"", "/sampler", Kind::index},
    {"", "/target", Kind::object},
    {"", "/target/node", Kind::index},
    {"", "/target/path", Kind::text},
};

constexpr Field sampler_fields[] = {
    {"", "/input", Kind::index},
    {"", "/output", Kind::index},
    {"", "/interpolation", Kind::text},
};

// tinygltf keeps indices in an int and counts of bytes in a size_t; what does not fit would wrap around in silence.
bool is_below(const json& value, uint64_t limit) { return value.is_number_unsigned() && value.get<uint64_t>() < limit; }
bool is_index(const json& value) { return is_below(value, uint64_t{1} << 31); }
bool is_size(const json& value) { return is_below(value, uint64_t{1} << 48); }

bool matches(const json& value, const Field& field) {
  const auto every = [&](auto&& test) { return value.is_array() && std::all_of(value.begin(), value.end(), test); };
  switch (field.kind) {
    case Kind::number:
      return value.is_number();
    case Kind::index:
      return is_index(value);
    case Kind::size:
      return is_size(value);
    case Kind::numbers:
      return every([](const json& v) { return v.is_number(); }) && (field.length == 0 || value.size() == field.length);
    case Kind::indices:
      return every(is_index);
    case Kind::text:
      return value.is_string();
    case Kind::boolean:
      return value.is_boolean();
    case Kind::object:
      return value.is_object();
    case Kind::array:
      return value.is_array();
  }
  return false;
}

std::string expected(const Field& field) {
  switch (field.kind) {
    case Kind::number:
      return "a number";
    case Kind::index:
      return "a non-negative integer below 2^31";
    case Kind::size:
      return "a non-negative integer below 2^48";
    case Kind::numbers:
      return field.length ? std::to_string(field.length) + " numbers" : "an array of numbers";
    case Kind::indices:
      return "an array of non-negative integers below 2^31";
    case Kind::text:
      return "a string";
    case Kind::boolean:
      return "true or false";
    case Kind::object:
      return "an object";
    case Kind::array:
      return "an array";
  }
  return "";
}

void check_field(const json& element, const Field& field, const std::string& where) {
  const json::json_pointer pointer(field.pointer);
  if (!element.is_object()) ks::fail(KS_ERROR_FILE, "%s is not an object", where.c_str());
  if (element.contains(pointer) && !matches(element.at(pointer), field))
    ks::fail(KS_ERROR_FILE, "%s%s is %.60s, must be %s", where.c_str(), field.pointer,
             element.at(pointer).dump(-1, ' ', true, json::error_handler_t::replace).c_str(), expected(field).c_str());
}

/// Elements of an array that may be absent, each with its name for messages.
template <class Function>
void for_each(const json& root, const char* pointer, const std::string& name, Function&& function) {
  const json::json_pointer at(pointer);
  if (!root.is_object() || !root.contains(at)) return;
  if (!root.at(at).is_array()) ks::fail(KS_ERROR_FILE, "%s is not an array", name.c_str());
  size_t i = 0;
  for (const json& element : root.at(at)) function(element, name + "[" + std::to_string(i++) + "]");
}

void check_textures(const json& root) {
  for_each(root, "/materials", "materials", [](const json& material, const std::string& name) {
    for (const char* place : texture_places) {
      const json::json_pointer at(place);
      if (!material.contains(at)) continue;
      for (const Field& field : texture_fields) check_field(material.at(at), field, name + place);
    }
  });
}

void check_primitives(const json& root) {
  for_each(root, "/meshes", "meshes", [](const json& mesh, const std::string& mesh_name) {
    for_each(mesh, "/primitives", mesh_name + "/primitives", [](const json& primitive, const std::string& name) {
      for (const Field& field : primitive_fields) check_field(primitive, field, name);
      if (!primitive.contains("attributes")) ks::fail(KS_ERROR_FILE, "%s/attributes is missing", name.c_str());
      for (const auto& [key, accessor] : primitive["attributes"].items())
        if (!is_index(accessor)) ks::fail(KS_ERROR_FILE, "%s/attributes/%.40s must be an accessor's index", name.c_str(), key.c_str());
      for_each(primitive, "/targets", name + "/targets", [](const json& target, const std::string& target_name) {
        if (!target.is_object()) ks::fail(KS_ERROR_FILE, "%s is not an object", target_name.c_str());
        for (const auto& [key, accessor] : target.items())
          if (!is_index(accessor)) ks::fail(KS_ERROR_FILE, "%s/%.40s must be an accessor's index", target_name.c_str(), key.c_str());
      });
    });
  });
}

void check_animations(const json& root) {
  for_each(root, "/animations", "animations", [](const json& animation, const std::string& animation_name) {
    for_each(animation, "/channels", animation_name + "/channels", [](const json& channel, const std::string& name) {
      for (const Field& field : channel_fields) check_field(channel, field, name);
    });
    for_each(animation, "/samplers", animation_name + "/samplers", [](const json& sampler, const std::string& name) {
      for (const Field& field : sampler_fields) check_field(sampler, field, name);
    });
  });
}

/// Every buffer view lies inside its buffer.
void check_views(const json& root) {
  const json none = json::array();
  const json& buffers = root.contains("buffers") ? root["buffers"] : none;
  for_each(root, "/bufferViews", "bufferViews", [&](const json& view, const std::string& name) {
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
  for (const Field& field : fields)
    for_each(root, field.table, field.table + 1, [&](const json& element, const std::string& name) { check_field(element, field, name); });
  check_textures(root);
  check_primitives(root);
  check_animations(root);
  check_views(root);
  return root;
}

}  // namespace kuafu
