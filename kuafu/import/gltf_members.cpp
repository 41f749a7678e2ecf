// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_members.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace kuafu {
namespace {

using nlohmann::json;

constexpr size_t most_names = 10;

struct Object {
  std::string_view place;    // JSON pointer from the root; * stands for every element of an array
  std::string_view members;  // one blank between two
};

// The glTF 2.0 specification, section 5, and KHR_lights_punctual. Every object may have extensions and extras besides.
constexpr Object objects[] = {
    {"",
     "accessors animations asset buffers bufferViews cameras extensionsRequired extensionsUsed images materials meshes nodes samplers "
     "scene scenes skins textures"},
    {"/accessors/*", "bufferView byteOffset componentType count max min name normalized sparse type"},
    {"/accessors/*/sparse", "count indices values"},
    {"/animations/*", "channels name samplers"},
    {"/animations/*/channels/*", "sampler target"},
    {"/animations/*/channels/*/target", "node path"},
    {"/animations/*/samplers/*", "input interpolation output"},
    {"/bufferViews/*", "buffer byteLength byteOffset byteStride name target"},
    {"/buffers/*", "byteLength name uri"},
    {"/cameras/*", "name orthographic perspective type"},
    {"/cameras/*/perspective", "aspectRatio yfov zfar znear"},
    {"/extensions/KHR_lights_punctual/lights/*", "color intensity name range spot type"},
    {"/extensions/KHR_lights_punctual/lights/*/spot", "innerConeAngle outerConeAngle"},
    {"/images/*", "bufferView mimeType name uri"},
    {"/materials/*",
     "alphaCutoff alphaMode doubleSided emissiveFactor emissiveTexture name normalTexture occlusionTexture pbrMetallicRoughness"},
    {"/materials/*/emissiveTexture", "index texCoord"},
    {"/materials/*/normalTexture", "index scale texCoord"},
    {"/materials/*/pbrMetallicRoughness", "baseColorFactor baseColorTexture metallicFactor metallicRoughnessTexture roughnessFactor"},
    {"/materials/*/pbrMetallicRoughness/baseColorTexture", "index texCoord"},
    {"/materials/*/pbrMetallicRoughness/metallicRoughnessTexture", "index texCoord"},
    {"/meshes/*", "name primitives weights"},
    {"/meshes/*/primitives/*", "attributes indices material mode targets"},
    {"/nodes/*", "camera children matrix mesh name rotation scale skin translation weights"},
    {"/samplers/*", "magFilter minFilter name wrapS wrapT"},
    {"/scenes/*", "name nodes"},
    {"/skins/*", "inverseBindMatrices joints name skeleton"},
    {"/textures/*", "name sampler source"},
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

/// Letters to add, to drop or to change on the way from a to b (Levenshtein 1966).
size_t distance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = std::exchange(row[0], i + 1);
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

/// "; is 'indices' meant?", or nothing where no member is near.
std::string offer(std::string_view name, const std::vector<std::string_view>& known) {
  constexpr size_t farthest = 2;
  std::string_view nearest;
  size_t least = farthest + 1;
  for (const std::string_view member : known) {
    if (name.size() > member.size() + farthest) continue;
    if (const size_t d = distance(name, member); d < least && 2 * d < member.size()) least = d, nearest = member;
  }
  return nearest.empty() ? "" : "; is '" + std::string(nearest) + "' meant?";
}

class Looker {
 public:
  explicit Looker(Import& import) : import_(import) {}

  void look(const json& root) {
    for (const Object& object : objects) {
      known_ = words(object.members, ' ');
      object_ = &object;
      descend(root, words(object.place.substr(std::min<size_t>(1, object.place.size())), '/'), 0, "");
    }
    if (more_) import_.warn("more members are unknown and ignored");
  }

 private:
  /// what: how far the place is known, for messages.
  void descend(const json& value, const std::vector<std::string_view>& place, size_t depth, const std::string& what) {
    if (depth == place.size()) return look_at(value, what);
    if (place[depth] == "*") {
      if (!value.is_array()) return;
      for (size_t i = 0; i < value.size(); ++i) descend(value[i], place, depth + 1, what + "[" + std::to_string(i) + "]");
    } else if (value.is_object()) {
      const auto member = value.find(place[depth]);
      if (member != value.end()) descend(*member, place, depth + 1, what + (depth > 0 ? "/" : "") + std::string(place[depth]));
    }
  }

  void look_at(const json& value, const std::string& what) {
    if (!value.is_object()) return;
    for (auto member = value.begin(); member != value.end(); ++member) {
      const std::string& name = member.key();
      if (name == "extensions" || name == "extras" || std::ranges::find(known_, name) != known_.end()) continue;
      if (said_.contains({object_, name})) continue;
      if (said_.size() == most_names) {
        more_ = true;
        return;
      }
      said_.insert({object_, name});
      import_.warn((what.empty() ? "the file" : what) + ": member '" + clean_name(name) + "' is unknown and ignored" + offer(name, known_));
    }
  }

  Import& import_;
  const Object* object_ = nullptr;
  std::vector<std::string_view> known_;
  std::set<std::pair<const Object*, std::string>> said_;
  bool more_ = false;
};

}  // namespace

void warn_of_unknown_members(Import& import, const json& root) { Looker(import).look(root); }

}  // namespace kuafu
