// SPDX-License-Identifier: Apache-2.0
#include "import/assimp_files.h"

#include <array>
#include <pugixml.hpp>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "device/error.h"

namespace kuafu {
namespace {

uint64_t number_of(const pugi::xml_node& node, const char* name, uint64_t otherwise) {
  const pugi::xml_attribute attribute = node.attribute(name);
  return attribute ? attribute.as_ullong() : otherwise;
}

/// Parts that no instance shows, by the libraries that hold them. assimp refuses two cameras of one name, which a part often has.
constexpr std::array unread_libraries = {std::pair{"library_cameras", "cameras"}, std::pair{"library_lights", "lights"},
                                         std::pair{"library_animations", "animations"},
                                         std::pair{"library_animation_clips", "animation clips"}};

/// Visits nodes in the file's order, without recursion: a file may nest them as deep as it likes.
struct Visit : pugi::xml_tree_walker {
  std::unordered_map<std::string, uint64_t> counts;
  std::vector<pugi::xml_node> accessors, unread;

  bool for_each(pugi::xml_node& node) override {
    const std::string_view name = node.name();
    if (name.ends_with("_array")) counts[std::string("#").append(node.attribute("id").value())] = number_of(node, "count", 0);
    if (name == "accessor") accessors.push_back(node);
    if (name == "instance_camera" || name == "instance_light") unread.push_back(node);
    return true;
  }
};

void check_accessors(const Visit& file) {
  for (const pugi::xml_node& accessor : file.accessors) {
    const std::string source = accessor.attribute("source").value();
    const auto array = file.counts.find(source);
    if (array == file.counts.end()) continue;  // assimp says so
    const uint64_t count = number_of(accessor, "count", 0), stride = number_of(accessor, "stride", 1),
                   offset = number_of(accessor, "offset", 0);
    const uint64_t have = array->second;
    if (offset > have || (stride != 0 && count > (have - offset) / stride))
      ks::fail(KS_ERROR_FILE, "an accessor takes %llu times %llu values from number %llu on of '%.60s', which has %llu",
               static_cast<unsigned long long>(count), static_cast<unsigned long long>(stride), static_cast<unsigned long long>(offset),
               source.c_str(), static_cast<unsigned long long>(have));
  }
}

struct Bytes : pugi::xml_writer {
  std::vector<uint8_t> all;
  void write(const void* data, size_t size) override {
    const auto* const bytes = static_cast<const uint8_t*>(data);
    all.insert(all.end(), bytes, bytes + size);
  }
};

}  // namespace

std::vector<uint8_t> plain_collada(Import& import, std::string_view file) {
  pugi::xml_document document;
  constexpr unsigned how = pugi::parse_default | pugi::parse_trim_pcdata | pugi::parse_wnorm_attribute;
  const pugi::xml_parse_result result = document.load_buffer(file.data(), file.size(), how);
  if (!result) ks::fail(KS_ERROR_FILE, "this is no XML: at byte %td: %s", result.offset, result.description());
  Visit visit;
  document.traverse(visit);
  check_accessors(visit);
  for (auto node = visit.unread.rbegin(); node != visit.unread.rend(); ++node) node->parent().remove_child(*node);  // inner ones first
  pugi::xml_node root = document.document_element();
  for (const auto& [library, content] : unread_libraries) {
    if (root.child(library).first_child()) import.warn(std::string("its ") + content + " are left out: those of Collada are not read");
    while (root.remove_child(library)) continue;
  }
  Bytes out;
  document.save(out, "", pugi::format_raw, pugi::encoding_utf8);
  return std::move(out.all);
}

}  // namespace kuafu
