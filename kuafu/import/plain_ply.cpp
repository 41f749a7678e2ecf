// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <cstring>
#include <string>

#include "import/plain_mesh.h"
#include "import/plain_text.h"

namespace kuafu {
namespace {

using View = std::string_view;

struct Property {
  char type = 'f';      // i, u, f
  size_t bytes = 0;     // of the number
  char count_type = 0;  // of a list's length; 0 = no list
  size_t count_bytes = 0;
  int axis = -1;  // 0 to 2: x, y, z of a vertex
  bool is_corners = false;
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

void set_type(View word, char& type, size_t& bytes) {
  type = word.starts_with('u') ? 'u' : word.starts_with('f') || word.starts_with('d') ? 'f' : 'i';
  const View kind = word.substr(word.starts_with('u') ? 1 : 0);
  bytes = kind == "char" || kind == "int8" ? 1 : kind == "short" || kind == "int16" ? 2 : kind == "double" || kind == "float64" ? 8 : 4;
}

class PlyReader {
 public:
  explicit PlyReader(View file) : rest_(file), most_numbers_(static_cast<double>(file.size())) { header(); }

  [[nodiscard]] bool has_strips() const {
    for (const Element& element : elements_)
      if (element.name == "tristrips") return true;
    return false;
  }

  PlainMesh read() {
    for (const Element& element : elements_)
      for (uint64_t i = 0; i < element.count; ++i) one(element);
    if (used_.size() > positions_.size()) ks::fail(KS_ERROR_FILE, "a face names vertex %zu of %zu", used_.size() - 1, positions_.size());
    for (size_t i = 0; i < used_.size(); ++i)
      if (used_[i]) mesh_.use(positions_[i]);
    return mesh_;
  }

 private:
  void header() {
    while (true) {
      if (rest_.empty()) ks::fail(KS_ERROR_FILE, "line %zu: the header has no end", static_cast<size_t>(line_ + 1));
      View line = take_line(rest_);
      ++line_;
      const View kind = take_word(line);
      if (kind == "end_header") return;
      if (kind == "format") {
        const View format = take_word(line);
        is_ascii_ = format == "ascii";
        is_big_ = format == "binary_big_endian";
      } else if (kind == "element") {
        const View name = take_word(line), count = take_word(line);
        elements_.push_back({std::string(name), 0, {}});
        std::from_chars(count.data(), count.data() + count.size(), elements_.back().count);
        if (static_cast<double>(elements_.back().count) > most_numbers_) fail_end();
      } else if (kind == "property") {
        property(line);
      }
    }
  }

  void property(View words) {
    if (elements_.empty()) ks::fail(KS_ERROR_FILE, "line %zu: a property stands before its element", static_cast<size_t>(line_));
    Element& element = elements_.back();
    Property p;
    View word = take_word(words);
    if (word == "list") {
      set_type(take_word(words), p.count_type, p.count_bytes);
      word = take_word(words);
    }
    set_type(word, p.type, p.bytes);
    const View name = take_word(words);
    if (element.name == "vertex" && p.count_type == 0 && name.size() == 1 && name[0] >= 'x' && name[0] <= 'z') p.axis = name[0] - 'x';
    p.is_corners = element.name == "face" && p.count_type != 0 && (name == "vertex_indices" || name == "vertex_index");
    element.properties.push_back(p);
  }

  void one(const Element& element) {
    glm::dvec3 position(0.0);
    for (const Property& p : element.properties) {
      const double length = p.count_type == 0 ? 1.0 : number(p.count_type, p.count_bytes, true);
      if (!(length >= 0.0 && length <= most_numbers_)) fail_end();
      for (uint64_t k = 0; k < static_cast<uint64_t>(length); ++k) {
        const double value = number(p.type, p.bytes, p.axis >= 0 || p.is_corners);
        if (p.axis >= 0) position[p.axis] = value;
        if (p.is_corners && length >= 3.0) use(value);
      }
      if (p.is_corners && length >= 3.0) ++mesh_.faces, mesh_.corners += static_cast<uint64_t>(length);
    }
    if (element.name == "vertex") positions_.push_back(position);
  }

  void use(double index) {
    if (!(index >= 0.0 && index < most_numbers_))
      ks::fail(KS_ERROR_FILE, "face %llu names vertex %.0f", static_cast<unsigned long long>(mesh_.faces), index);
    const auto at = static_cast<size_t>(index);
    if (used_.size() <= at) used_.resize(at + 1);
    used_[at] = true;
  }

  double number(char type, size_t bytes, bool is_needed) {
    if (is_ascii_) return text_number(is_needed);
    if (rest_.size() < bytes) fail_end();
    uint64_t bits = 0;
    for (size_t i = 0; i < bytes; ++i) bits |= uint64_t{static_cast<uint8_t>(rest_[i])} << (8 * (is_big_ ? bytes - 1 - i : i));
    rest_.remove_prefix(bytes);
    if (type == 'f') return bytes == 4 ? double{std::bit_cast<float>(static_cast<uint32_t>(bits))} : std::bit_cast<double>(bits);
    if (type == 'u') return static_cast<double>(bits);
    const auto unused = static_cast<unsigned>(64 - 8 * bytes);
    return static_cast<double>(static_cast<int64_t>(bits << unused) >> unused);
  }

  double text_number(bool is_needed) {
    View word = take_word(words_);
    while (word.empty()) {
      if (rest_.empty()) fail_end();
      words_ = take_line(rest_);
      ++line_;
      word = take_word(words_);
    }
    return is_needed ? parse_real(word, line_) : 0.0;
  }

  [[noreturn]] static void fail_end() { ks::fail(KS_ERROR_FILE, "the file ends before the elements that its header announces"); }

  View rest_, words_;
  double most_numbers_;  // no file has more of anything than bytes
  uint64_t line_ = 0;
  bool is_ascii_ = false, is_big_ = false;
  std::vector<Element> elements_;
  std::vector<glm::dvec3> positions_;
  std::vector<bool> used_;
  PlainMesh mesh_;
};

}  // namespace

std::optional<PlainMesh> plain_ply(std::string_view file) {
  PlyReader reader(file);
  if (reader.has_strips()) return std::nullopt;
  return reader.read();
}

}  // namespace kuafu
