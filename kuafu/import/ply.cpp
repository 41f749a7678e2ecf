// SPDX-License-Identifier: Apache-2.0
// PLY, ASCII and binary (Turk, The PLY polygon file format, 1994), with the colours and textures that MeshLab writes: comment TextureFile,
// and coordinates of vertices or of the faces' corners.
#include <algorithm>
#include <array>
#include <bit>
#include <filesystem>

#include "import/phong_textures.h"
#include "import/polygons.h"
#include "import/text.h"

namespace kuafu {
namespace {

using View = std::string_view;

constexpr size_t most_header_lines = 1000;

/// Meanings of the properties of vertices and faces: numbers, then lists.
struct Role {
  enum Kind : size_t { x, y, z, nx, ny, nz, red, green, blue, alpha, u, v, image, numbers, corners = numbers, uvs, none };
};
constexpr size_t list_kinds = Role::none - Role::numbers;
/// What programs call each of them.
constexpr std::array<std::array<View, 4>, Role::none> role_names = {{
    {"x"},
    {"y"},
    {"z"},
    {"nx"},
    {"ny"},
    {"nz"},
    {"red", "r", "diffuse_red"},
    {"green", "g", "diffuse_green"},
    {"blue", "b", "diffuse_blue"},
    {"alpha", "a"},
    {"u", "s", "texture_u", "texture_s"},
    {"v", "t", "texture_v", "texture_t"},
    {"texnumber"},
    {"vertex_indices", "vertex_index"},
    {"texcoord"},
}};

/// The role of a property, which is a list or a number.
Role::Kind role_of(View name, bool is_list) {
  for (size_t role = 0; role < role_names.size() && !name.empty(); ++role)
    if ((role >= Role::numbers) == is_list && std::ranges::find(role_names[role], name) != role_names[role].end()) return Role::Kind{role};
  return Role::none;
}

struct Type {
  char kind = 'f';  // i, u, f
  size_t bytes = 0;
};
struct TypeName {
  View old_name, name;
  Type type;
};
constexpr std::array type_names = {
    TypeName{"char", "int8", {'i', 1}},     TypeName{"uchar", "uint8", {'u', 1}},    TypeName{"short", "int16", {'i', 2}},
    TypeName{"ushort", "uint16", {'u', 2}}, TypeName{"int", "int32", {'i', 4}},      TypeName{"uint", "uint32", {'u', 4}},
    TypeName{"float", "float32", {'f', 4}}, TypeName{"double", "float64", {'f', 8}},
};

[[noreturn]] void fail_header(View line) { ks::fail(KS_ERROR_FILE, "the PLY header has the line '%.60s'", std::string(line).c_str()); }

Type type_of(View word, View line) {
  const auto* const found = std::ranges::find_if(type_names, [&](const TypeName& t) { return word == t.old_name || word == t.name; });
  if (found == type_names.end()) fail_header(line);
  return found->type;
}

struct Property {
  Type type, count;  // of the number, or of a list's numbers and of their count; 0 bytes: no list
  Role::Kind role = Role::none;
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;

  [[nodiscard]] bool has(Role::Kind role) const {
    return std::ranges::any_of(properties, [&](const Property& p) { return p.role == role; });
  }
};

class PlyReader {
 public:
  PlyReader(Import& import, View file) : import_(import), rest_(file), most_numbers_(static_cast<double>(file.size())) { header(); }

  Polygons read() {
    for (const Element& element : elements_) {
      const bool is_vertex = element.name == "vertex", is_strip = element.name == "tristrips";
      if (is_vertex && !(element.has(Role::x) && element.has(Role::y) && element.has(Role::z)))
        ks::fail(KS_ERROR_FILE, "its vertices have no x, y and z");
      if (!is_vertex && !is_strip && element.name != "face" && element.count > 0)
        import_.warn("its element '" + element.name.substr(0, 40) + "' is not read");
      for (uint64_t i = 0; i < element.count; ++i) {
        one(element);
        if (is_vertex) vertex(element);
        if (is_strip) strips();
        if (element.name == "face") face(element, lists_[Role::corners - Role::numbers]);
      }
    }
    for (PolygonPart& part : out_.parts) finish(part);
    return std::move(out_);
  }

 private:
  // --- the header ---

  void header() {
    const size_t first = std::min(rest_.find_first_of("\r\n"), rest_.size());
    // Old Macs end lines by "\r" alone. The bytes behind a header may begin with a "\n" that is part of them.
    const char end = rest_.substr(first).starts_with('\r') && !rest_.substr(first).starts_with("\r\n") ? '\r' : '\n';
    for (size_t number = 0;; ++number) {
      const size_t size = rest_.find(end);
      if (size == View::npos) ks::fail(KS_ERROR_FILE, "the PLY header does not end");
      const View line = trimmed(rest_.substr(0, size));
      rest_.remove_prefix(size + 1);
      ++line_;
      if (number == 0 && line != "ply") ks::fail(KS_ERROR_FILE, "this is not a PLY file");
      if (number > most_header_lines) ks::fail(KS_ERROR_FILE, "the PLY header has more than %zu lines", most_header_lines);
      if (number > 0 && line == "end_header") break;
      if (number > 0) header_line(line);
    }
    if (!has_format_) ks::fail(KS_ERROR_FILE, "the PLY header has no format line");
    for (const Element& element : elements_)
      if (element.name == "vertex")
        has_colors_ = element.has(Role::red), has_uvs_ = element.has(Role::u), has_normals_ = element.has(Role::nx);
    for (const Element& element : elements_)  // those of the corners say more
      if (element.name == "face" && element.has(Role::uvs)) has_uvs_ = false;
  }

  void header_line(View line) {
    View words = line;
    const View kind = take_word(words);
    if (kind == "comment") {
      if (lower_case(take_word(words)) == "texturefile") images_.emplace_back(trimmed(words));
    } else if (kind == "format") {
      const View format = take_word(words);
      is_ascii_ = format == "ascii";
      is_big_ = format == "binary_big_endian";
      has_format_ = is_ascii_ || is_big_ || format == "binary_little_endian";
    } else if (kind == "element") {
      const View name = take_word(words), count = take_word(words);
      Element& element = elements_.emplace_back();
      element.name = name;
      const auto [end, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
      if (error != std::errc() || end != count.data() + count.size()) fail_header(line);
      if (static_cast<double>(element.count) > most_numbers_)
        ks::fail(KS_ERROR_FILE, "the count of element %.40s is %zu, but the file has only %.0f bytes: it is truncated or broken",
                 element.name.c_str(), static_cast<size_t>(element.count), most_numbers_);
    } else if (kind == "property" && !elements_.empty()) {
      Property p;
      View word = take_word(words);
      if (word == "list") {
        p.count = type_of(take_word(words), line);
        word = take_word(words);
      }
      p.type = type_of(word, line);
      p.role = role_of(trimmed(words), p.count.bytes > 0);
      elements_.back().properties.push_back(p);
    } else if (kind != "obj_info") {
      fail_header(line);
    }
  }

  // --- numbers ---

  /// Reads an element into values_ and lists_.
  void one(const Element& element) {
    words_ = {};  // what stands behind the last one in its line belongs to nothing: MeshLab writes more there than its header says
    for (const Property& p : element.properties) {
      const double length = p.count.bytes == 0 ? 1.0 : number(p.count, true);
      if (!(length >= 0.0 && length <= most_numbers_)) fail_end();
      std::vector<double>* const list = p.role >= Role::numbers && p.role < Role::none ? &lists_[p.role - Role::numbers] : nullptr;
      if (list != nullptr) list->clear();
      for (uint64_t k = 0; k < static_cast<uint64_t>(length); ++k) {
        const double value = number(p.type, p.role != Role::none);
        if (list != nullptr)
          list->push_back(value);
        else if (p.role < Role::numbers)
          values_[p.role] =
              p.role >= Role::red && p.role <= Role::alpha && p.type.kind != 'f' ? value / (p.type.bytes == 2 ? 65535.0 : 255.0) : value;
      }
    }
  }

  double number(Type type, bool is_needed) {
    if (is_ascii_) return text_number(is_needed);
    if (rest_.size() < type.bytes) fail_end();
    uint64_t bits = 0;
    for (size_t i = 0; i < type.bytes; ++i) bits |= uint64_t{static_cast<uint8_t>(rest_[i])} << (8 * (is_big_ ? type.bytes - 1 - i : i));
    rest_.remove_prefix(type.bytes);
    if (type.kind == 'f') return type.bytes == 4 ? double{std::bit_cast<float>(static_cast<uint32_t>(bits))} : std::bit_cast<double>(bits);
    if (type.kind == 'u') return static_cast<double>(bits);
    const auto unused = static_cast<unsigned>(64 - 8 * type.bytes);
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

  // --- vertices and faces ---

  [[nodiscard]] glm::vec3 values(Role::Kind first) const { return {values_[first], values_[first + 1], values_[first + 2]}; }

  void vertex(const Element& element) {
    const glm::vec3 position = values(Role::x);
    if (!std::isfinite(position.x + position.y + position.z))
      ks::fail(KS_ERROR_FILE, "vertex %zu is at %g, %g, %g", out_.positions.size(), position.x, position.y, position.z);
    out_.positions.push_back(position);
    if (has_normals_) out_.normals.push_back(values(Role::nx));
    if (has_colors_) color(element);
    if (has_uvs_) out_.uvs.emplace_back(values_[Role::u], values_[Role::v]);
  }

  void color(const Element& element) {
    out_.colors.push_back(linear_color({values(Role::red), element.has(Role::alpha) ? static_cast<float>(values_[Role::alpha]) : 1.0f}));
  }

  /// Its colour counts where the vertices have none.
  void face(const Element& element, const std::vector<double>& named) {
    PolygonPart& part = part_of(element.has(Role::image) ? values_[Role::image] : 0.0);
    const std::vector<double>& places = lists_[Role::uvs - Role::numbers];
    const bool has_places = element.has(Role::uvs) && places.size() == 2 * named.size();
    const bool has_color = !has_colors_ && element.has(Role::red);
    if (has_color) color(element);
    const auto face_color = has_color ? static_cast<uint32_t>(out_.colors.size() - 1) : none;
    for (size_t k = 0; k < named.size(); ++k) {
      const double index = named[k];
      if (!(index >= 0.0 && index < most_numbers_)) ks::fail(KS_ERROR_FILE, "face %zu names vertex %.0f", faces_, index);
      Corner& corner = part.corners.emplace_back();
      corner.position = static_cast<uint32_t>(index);
      corner.color = face_color;
      if (!has_places) continue;
      corner.uv = static_cast<uint32_t>(out_.uvs.size());
      out_.uvs.emplace_back(places[2 * k], places[2 * k + 1]);
    }
    part.close(named.size());
    ++faces_;
  }

  /// Triangles that share sides, each the other way round than the one before; -1 begins anew.
  void strips() {
    const std::vector<double>& strip = lists_[Role::corners - Role::numbers];
    size_t begin = 0;
    for (size_t k = 0; k < strip.size(); ++k) {
      if (strip[k] < 0.0) begin = k + 1;
      if (k < begin + 2) continue;
      const bool is_even = (k - begin) % 2 == 0;
      face({}, {strip[k - 2], strip[is_even ? k - 1 : k], strip[is_even ? k : k - 1]});
    }
  }

  /// The material of the image with this number; one more has no image.
  PolygonPart& part_of(double number) {
    const size_t index = number >= 0.0 && number < static_cast<double>(images_.size()) ? static_cast<size_t>(number) : images_.size();
    while (out_.parts.size() <= index) out_.parts.emplace_back();
    return out_.parts[index];
  }

  void finish(PolygonPart& part) {
    const auto index = static_cast<size_t>(&part - out_.parts.data());
    bool has_places = has_uvs_;
    for (Corner& corner : part.corners) {
      if (corner.position >= out_.positions.size())
        ks::fail(KS_ERROR_FILE, "a face names vertex %u of %zu", corner.position, out_.positions.size());
      has_places |= corner.uv != none;
      if (has_normals_) corner.normal = corner.position;
      if (has_colors_) corner.color = corner.position;
      if (has_uvs_) corner.uv = corner.position;
    }
    if (index >= images_.size() || part.sizes.empty()) return;
    if (!has_places)
      return import_.warn("it is shown without its texture '" + clean_name(images_[index]) + "': it has no texture coordinates");
    PhongMaterial textured{.name = std::filesystem::path(images_[index]).stem().string(), .diffuse = glm::vec3(1.0f)};
    textured.map(PhongMap::diffuse) = images_[index];
    PhongTextures textures(import_);
    const Material material = read_material(import_, textured, textures);
    if (material.base_color_texture == none) return;
    part.material = import_.scene.add_material(material);
    for (Corner& corner : part.corners) corner.color = none;  // they say the same in less detail
  }

  Import& import_;
  View rest_, words_;
  double most_numbers_;  // no file has more of anything than bytes
  uint64_t line_ = 0;
  bool is_ascii_ = false, is_big_ = false, has_format_ = false;
  std::vector<Element> elements_;
  std::vector<std::string> images_;
  bool has_colors_ = false, has_uvs_ = false, has_normals_ = false;  // of vertices
  std::array<double, Role::numbers> values_{};
  std::array<std::vector<double>, list_kinds> lists_;
  Polygons out_;
  size_t faces_ = 0;
};

}  // namespace

Polygons read_ply(Import& import, View file) { return PlyReader(import, file).read(); }

}  // namespace kuafu
