// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "import/gltf_schema.h"

namespace kuafu {
namespace {

using nlohmann::json;

constexpr size_t most_names = 10;

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
std::string offer(std::string_view name, const std::vector<GltfMember>& known) {
  constexpr size_t farthest = 2;
  std::string_view nearest;
  size_t least = farthest + 1;
  for (const auto& [member, kind] : known) {
    if (name.size() > member.size() + farthest) continue;
    if (const size_t d = distance(name, member); d < least && 2 * d < member.size()) least = d, nearest = member;
  }
  return nearest.empty() ? "" : "; is '" + std::string(nearest) + "' meant?";
}

}  // namespace

void warn_of_unknown_members(Import& import, const json& root) {
  std::set<std::pair<std::string_view, std::string>> said;  // places and members
  bool more = false;
  visit_gltf_objects(root, [&](const GltfObject& object, const json& value, const std::string& what) {
    if (object.is_open) return;
    for (const auto& [name, _] : value.items()) {
      if (name == "extensions" || name == "extras" || std::ranges::find(object.members, name, &GltfMember::name) != object.members.end())
        continue;
      if (said.contains({object.place, name})) continue;
      if (said.size() == most_names) {
        more = true;
        return;
      }
      said.insert({object.place, name});
      const std::string who = what.empty() ? "the file" : what;
      import.warn(who + ": member '" + clean_name(name) + "' is unknown and ignored" + offer(name, object.members));
    }
  });
  if (more) import.warn("more members are unknown and ignored");
}

}  // namespace kuafu
