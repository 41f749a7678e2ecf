// SPDX-License-Identifier: Apache-2.0
// Wavefront OBJ (Wavefront Technologies, Advanced Visualizer manual, appendix B1): polygons with their materials.
#include <array>
#include <charconv>
#include <map>
#include <set>

#include "import/phong_material.h"
#include "import/phong_textures.h"
#include "import/polygons.h"
#include "import/text.h"

namespace kuafu {
namespace {

using View = std::string_view;

/// Positions, texture coordinates and normals, in the order in which a corner names them.
struct Named {
  enum Kind : size_t { position, texture, normal, kinds };
};
constexpr std::array<const char*, Named::kinds> named_words = {"vertex", "texture coordinate", "normal"};

class ObjReader {
 public:
  ObjReader(Import& import, View file)
      : import_(import), rest_(without_mark(file)), most_index_(static_cast<long long>(std::min<size_t>(file.size(), none - 1))) {}

  Polygons read() {
    while (!rest_.empty()) {
      line_ += lines_joined_ + 1;
      lines_joined_ = 0;
      statement(next_statement());
    }
    finish_corners();
    find_materials();
    return std::move(out_);
  }

 private:
  /// A line with those that it goes on in after a backslash.
  View next_statement() {
    View line = take_line(rest_);
    if (!line.ends_with('\\') || trimmed(line).starts_with('#')) return line;
    joined_.clear();
    while (line.ends_with('\\')) {
      joined_.append(line.substr(0, line.size() - 1)).push_back(' ');
      if (rest_.empty()) return joined_;
      ++lines_joined_;
      line = take_line(rest_);
    }
    joined_.append(line);
    return joined_;
  }

  void statement(View line) {
    View words = line;
    const View name = take_word(words);
    if (name.empty() || name[0] == '#') return;
    if (name == "v" || name == "vt" || name == "vn")
      vertex(name, words.substr(0, words.find('#')));
    else if (name == "f" || name == "fo")
      face(words.substr(0, words.find('#')));
    else if (name == "o" || name == "g")
      name_ = trimmed(words), part_ = none;
    else if (name == "usemtl")
      material_ = trimmed(words), part_ = none;
    else if (name == "mtllib")
      read_mtl(import_, std::string(trimmed(words)), materials_);
    else if (name != "s" && left_out_.insert(std::string(name.substr(0, 40))).second)  // smoothing groups: normals say more
      import_.warn("line " + std::to_string(line_) + ": '" + std::string(name.substr(0, 40)) +
                   "' is not read: polygons alone are rendered");
  }

  void vertex(View name, View words) {
    std::array<float, 7> number{};
    size_t count = 0;
    for (View word = take_word(words); !word.empty(); word = take_word(words)) {
      if (count == number.size()) ks::fail(KS_ERROR_FILE, "line %zu: '%.*s' has more than 7 numbers", line_, int(name.size()), name.data());
      number[count++] = static_cast<float>(parse_real(word, line_));
    }
    const size_t least = name == "v" || name == "vn" ? 3 : 1;
    if (count < least)
      ks::fail(KS_ERROR_FILE, "line %zu: '%.*s' has %zu numbers, must have %zu", line_, int(name.size()), name.data(), count, least);
    if (name == "vt")
      out_.uvs.emplace_back(number[0], number[1]);
    else if (name == "vn")
      out_.normals.emplace_back(number[0], number[1], number[2]);
    else
      add_position(number, count);
  }

  /// x y z, x y z w, either with a colour behind it.
  void add_position(const std::array<float, 7>& number, size_t count) {
    if (count == 5)
      ks::fail(KS_ERROR_FILE, "line %zu: 'v' has 5 numbers, must have 3 (or 4 with a weight, and 3 more with a colour)", line_);
    const float weight = count % 3 == 1 ? number[3] : 1.0f;
    if (weight == 0.0f) ks::fail(KS_ERROR_FILE, "line %zu: a vertex has the weight 0", line_);
    out_.positions.push_back(glm::vec3(number[0], number[1], number[2]) / weight);
    if (count < 6) return;
    out_.colors.resize(out_.positions.size(), glm::vec4(1.0f));
    out_.colors.back() = linear_color({number[count - 3], number[count - 2], number[count - 1], 1.0f});
  }

  void face(View words) {
    PolygonPart& part = current_part();
    size_t count = 0;
    for (View word = take_word(words); !word.empty(); word = take_word(words), ++count) part.corners.push_back(corner(word));
    part.close(count);
  }

  PolygonPart& current_part() {
    if (part_ != none) return out_.parts[part_];
    const auto [found, is_new] = parts_.try_emplace({name_, material_}, static_cast<uint32_t>(out_.parts.size()));
    part_ = found->second;
    if (is_new) {
      out_.parts.push_back({name_, none, {}, {}});
      part_materials_.push_back(material_);
    }
    return out_.parts[part_];
  }

  /// "7", "7/3", "7//2", "7/3/2", and with nothing behind a stroke.
  Corner corner(View word) {
    View rest = word;
    std::array<uint32_t, Named::kinds> index{none, none, none};
    for (size_t k = 0; k < Named::kinds && !rest.empty(); ++k) {
      const size_t stroke = std::min(rest.find('/'), rest.size());
      if (stroke > 0) index[k] = absolute(static_cast<Named::Kind>(k), rest.substr(0, stroke), word);
      rest.remove_prefix(std::min(stroke + 1, rest.size()));
    }
    if (index[Named::position] == none || !rest.empty())
      ks::fail(KS_ERROR_FILE, "line %zu: '%.*s' is no corner", line_, static_cast<int>(std::min<size_t>(word.size(), 40)), word.data());
    return {index[Named::position], index[Named::texture], index[Named::normal]};
  }

  /// From 0 on. The file counts from 1, and back from what it has had so far where the number is negative.
  uint32_t absolute(Named::Kind kind, View digits, View word) {
    long long value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    const auto had = static_cast<long long>(kind == Named::position  ? out_.positions.size()
                                            : kind == Named::texture ? out_.uvs.size()
                                                                     : out_.normals.size());
    if (error != std::errc() || end != digits.data() + digits.size() || value == 0 || value > most_index_ || value < -had)
      ks::fail(KS_ERROR_FILE, "line %zu: corner '%.*s' names no %s: there are %lld so far", line_,
               static_cast<int>(std::min<size_t>(word.size(), 40)), word.data(), named_words[kind], had);
    const long long index = value > 0 ? value : had + 1 + value;
    if (index > most_[kind].index) most_[kind] = {index, line_};
    return static_cast<uint32_t>(index - 1);
  }

  /// Vertices that corners name may stand behind them.
  void finish_corners() {
    const std::array<size_t, Named::kinds> counts{out_.positions.size(), out_.uvs.size(), out_.normals.size()};
    for (size_t k = 0; k < Named::kinds; ++k)
      if (most_[k].index > static_cast<long long>(counts[k]) && (k == Named::position || counts[k] > 0))
        ks::fail(KS_ERROR_FILE, "line %zu: a corner names %s %lld of %zu", most_[k].line, named_words[k], most_[k].index, counts[k]);
    for (size_t k = Named::texture; k < Named::kinds; ++k) {
      if (counts[k] > 0 || most_[k].index == 0) continue;
      import_.warn(std::string("its faces name a ") + named_words[k] + " at each corner, but it has none");
      for (PolygonPart& part : out_.parts)
        for (Corner& corner : part.corners) (k == Named::texture ? corner.uv : corner.normal) = none;
    }
    if (out_.colors.empty()) return;
    out_.colors.resize(out_.positions.size(), glm::vec4(1.0f));
    for (PolygonPart& part : out_.parts)
      for (Corner& corner : part.corners) corner.color = corner.position;
  }

  /// Those that polygons use.
  void find_materials() {
    PhongTextures textures(import_);
    std::map<std::string, uint32_t> ids{{"", none}};
    for (size_t part = 0; part < out_.parts.size(); ++part) {
      const std::string& name = part_materials_[part];
      const auto [id, is_new] = ids.try_emplace(name, none);
      const auto found = materials_.find(name);
      if (is_new && found != materials_.end())
        id->second = import_.scene.add_material(read_material(import_, found->second, textures));
      else if (is_new)
        import_.warn("material '" + clean_name(name) + "' is in no MTL file that was read: what has it is grey");
      out_.parts[part].material = id->second;
    }
  }

  struct Most {
    long long index = 0;
    size_t line = 0;
  };

  Import& import_;
  View rest_;
  long long most_index_;  // no file has more vertices than bytes
  std::string joined_;
  size_t line_ = 0, lines_joined_ = 0;
  Polygons out_;
  std::string name_, material_;                                    // of the polygons that follow
  uint32_t part_ = none;                                           // they belong to; none = to be looked up
  std::map<std::pair<std::string, std::string>, uint32_t> parts_;  // by name and material
  std::vector<std::string> part_materials_;
  std::map<std::string, PhongMaterial> materials_;
  std::array<Most, Named::kinds> most_{};
  std::set<std::string> left_out_;  // statements
};

}  // namespace

Polygons read_obj(Import& import, View file) { return ObjReader(import, file).read(); }

}  // namespace kuafu
