// SPDX-License-Identifier: Apache-2.0
#include <pugixml.hpp>
#include <string>
#include <unordered_map>

#include "device/error.h"
#include "import/assimp_guard.h"

namespace kuafu {
namespace {

uint64_t number_of(const pugi::xml_node& node, const char* name, uint64_t otherwise) {
  const pugi::xml_attribute attribute = node.attribute(name);
  return attribute ? attribute.as_ullong() : otherwise;
}

/// Visits nodes in the file's order, without recursion: a file may nest them as deep as it likes.
struct Arrays : pugi::xml_tree_walker {
  std::unordered_map<std::string, uint64_t> counts;
  std::vector<pugi::xml_node> accessors;

  bool for_each(pugi::xml_node& node) override {
    const std::string_view name = node.name();
    if (name.ends_with("_array")) counts[std::string("#").append(node.attribute("id").value())] = number_of(node, "count", 0);
    if (name == "accessor") accessors.push_back(node);
    return true;
  }
};

}  // namespace

void check_collada(std::string_view file) {
  pugi::xml_document document;
  if (!document.load_buffer(file.data(), file.size())) return;  // assimp says what is wrong with it
  Arrays arrays;
  document.traverse(arrays);
  for (const pugi::xml_node& accessor : arrays.accessors) {
    const std::string source = accessor.attribute("source").value();
    const auto array = arrays.counts.find(source);
    if (array == arrays.counts.end()) continue;  // assimp says so
    const uint64_t count = number_of(accessor, "count", 0), stride = number_of(accessor, "stride", 1),
                   offset = number_of(accessor, "offset", 0);
    const uint64_t have = array->second;
    if (offset > have || (stride != 0 && count > (have - offset) / stride))
      ks::fail(KS_ERROR_FILE, "an accessor takes %llu times %llu values from number %llu on of '%.60s', which has %llu",
               static_cast<unsigned long long>(count), static_cast<unsigned long long>(stride), static_cast<unsigned long long>(offset),
               source.c_str(), static_cast<unsigned long long>(have));
  }
}

}  // namespace kuafu
