// SPDX-License-Identifier: Apache-2.0
#include "import/assimp_files.h"

#include <assimp/ObjMaterial.h>

#include <algorithm>

namespace kuafu {
namespace {

constexpr std::array<aiTextureType, static_cast<size_t>(PhongMap::count)> kinds = {  // in the order of PhongMap
    aiTextureType_DIFFUSE,           aiTextureType_SPECULAR,  aiTextureType_EMISSIVE, aiTextureType_OPACITY,
    aiTextureType_DIFFUSE_ROUGHNESS, aiTextureType_METALNESS, aiTextureType_HEIGHT,   aiTextureType_NORMALS};

void set(glm::vec3& to, const aiMaterial& from, const char* key, unsigned type, unsigned index) {
  aiColor3D c;
  if (from.Get(key, type, index, c) == AI_SUCCESS) to = {c.r, c.g, c.b};
}

std::optional<float> number(const aiMaterial& from, const char* key, unsigned type, unsigned index) {
  float value = 0.0f;
  if (from.Get(key, type, index, value) != AI_SUCCESS) return std::nullopt;
  return value;
}

}  // namespace

PhongMaterial phong_of(Import& import, const aiMaterial& from) {
  PhongMaterial to;
  aiString text;
  if (from.Get(AI_MATKEY_NAME, text) == AI_SUCCESS) to.name = text.C_Str();
  set(to.diffuse, from, AI_MATKEY_COLOR_DIFFUSE);
  set(to.specular, from, AI_MATKEY_COLOR_SPECULAR);
  set(to.emission, from, AI_MATKEY_COLOR_EMISSIVE);
  to.illum = static_cast<int>(number(from, AI_MATKEY_OBJ_ILLUM).value_or(2.0f));
  to.opacity = number(from, AI_MATKEY_OPACITY).value_or(1.0f);
  to.shininess = number(from, AI_MATKEY_SHININESS).value_or(0.0f);
  to.ior = number(from, AI_MATKEY_REFRACTI).value_or(1.5f);
  to.roughness = number(from, AI_MATKEY_ROUGHNESS_FACTOR);
  to.metallic = number(from, AI_MATKEY_METALLIC_FACTOR);
  to.bump = number(from, AI_MATKEY_OBJ_BUMPMULT_HEIGHT(0)).value_or(1.0f);
  for (int type = aiTextureType_NONE + 1; type <= AI_TEXTURE_TYPE_MAX; ++type) {
    const auto kind = static_cast<aiTextureType>(type);
    if (from.GetTextureCount(kind) == 0 || from.GetTexture(kind, 0, &text) != AI_SUCCESS || text.length == 0) continue;
    const auto* const at = std::find(kinds.begin(), kinds.end(), kind);
    if (at == kinds.end())
      import.warn("material '" + clean_name(to.name) + "': its texture of kind " + aiTextureTypeToString(kind) + " is ignored");
    else if (text.C_Str()[0] == '*')
      import.warn("material '" + clean_name(to.name) + "': embedded texture " + text.C_Str() + " is ignored");
    else
      to.maps[static_cast<size_t>(at - kinds.begin())] = text.C_Str();
  }
  return to;
}

}  // namespace kuafu
