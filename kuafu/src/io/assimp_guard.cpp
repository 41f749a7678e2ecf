#include "io/assimp_guard.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "device/error.h"

namespace kuafu {
namespace {

constexpr std::array ply_types = {"char", "uchar", "short", "ushort", "int",   "uint",   "float",   "double",
                                  "int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"};

bool is_ply_type(const std::string& word) { return std::find(ply_types.begin(), ply_types.end(), word) != ply_types.end(); }

uint64_t parse_count(std::string_view word, const char* what, uint64_t limit) {
  uint64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size())
    ks::fail(KS_ERROR_FILE, "%s is '%.*s', must be a number", what, static_cast<int>(std::min<size_t>(word.size(), 40)), word.data());
  if (value > limit)
    ks::fail(KS_ERROR_FILE, "%s is %zu, but the file has only %zu bytes: it is truncated or broken", what, static_cast<size_t>(value),
             static_cast<size_t>(limit));
  return value;
}

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

void check_ply_line(const std::vector<std::string>& words, const std::string& line, size_t file_bytes, size_t& elements) {
  const std::string& kind = words[0];
  if (kind == "comment" || kind == "obj_info") return;
  const bool element = kind == "element" && words.size() == 3;
  const bool scalar = kind == "property" && words.size() == 3 && is_ply_type(words[1]);
  const bool list = kind == "property" && words.size() == 5 && words[1] == "list" && is_ply_type(words[2]) && is_ply_type(words[3]);
  if (!element && !((scalar || list) && elements > 0)) ks::fail(KS_ERROR_FILE, "the PLY header has the line '%.60s'", line.c_str());
  if (!element) return;
  ++elements;
  parse_count(words[2], ("the count of element " + words[1]).c_str(), file_bytes);
}

/// The value of an attribute inside one start tag; nullopt when absent.
std::optional<std::string_view> attribute(std::string_view tag, const std::string& name) {
  for (size_t at = tag.find(name); at != std::string_view::npos; at = tag.find(name, at + 1)) {
    if (!std::isspace(static_cast<unsigned char>(tag[at - 1]))) continue;
    const size_t equals = tag.find_first_not_of(" \t\r\n", at + name.size());
    if (equals == std::string_view::npos || tag[equals] != '=') continue;
    const size_t quote = tag.find_first_of("\"'", equals);
    if (quote == std::string_view::npos) return std::nullopt;
    const size_t end = tag.find(tag[quote], quote + 1);
    if (end == std::string_view::npos) return std::nullopt;
    return tag.substr(quote + 1, end - quote - 1);
  }
  return std::nullopt;
}

struct Rule {
  const char* element;
  const char* required;
  bool count;
};
constexpr Rule collada_rules[] = {
    {"float_array", "count", true}, {"Name_array", "count", true}, {"IDREF_array", "count", true}, {"accessor", "count", true},
    {"accessor", "source", false},  {"input", "semantic", false},  {"input", "source", false},     {"triangles", "count", true},
    {"polylist", "count", true},    {"polygons", "count", true},   {"geometry", "id", false},      {"instance_geometry", "url", false},
};

// Text of these is numbers only; a reader that meets anything else stands still on it.
constexpr std::array collada_indices = {"p", "vcount", "v", "h"};
constexpr std::array collada_numbers = {"float_array", "matrix", "translate", "rotate", "scale", "lookat", "skew", "float", "color"};

template <class Number>
void check_numbers(std::string_view text, std::string_view name) {
  const char* const end = text.data() + text.size();
  for (const char* at = text.data(); at != end;) {
    if (std::isspace(static_cast<unsigned char>(*at))) {
      ++at;
      continue;
    }
    Number value;
    const auto [next, error] = std::from_chars(at + (*at == '+'), end, value);
    if (error == std::errc::invalid_argument || (next != end && !std::isspace(static_cast<unsigned char>(*next))))
      ks::fail(KS_ERROR_FILE, "<%.*s> has '%.20s', which is no number", static_cast<int>(name.size()), name.data(),
               std::string(at, end).c_str());
    at = next;
  }
}

void check_tag(std::string_view tag, std::string_view name, size_t file_bytes) {
  for (const Rule& rule : collada_rules) {
    if (name != rule.element) continue;
    const std::string field = std::string(rule.element) + "." + rule.required;
    const std::optional<std::string_view> value = attribute(tag, rule.required);
    if (!value) ks::fail(KS_ERROR_FILE, "%s is missing in <%.60s>", field.c_str(), std::string(tag).c_str());
    if (rule.count) parse_count(*value, field.c_str(), file_bytes);
  }
}

}  // namespace

void check_ply(std::string_view file) {
  size_t at = 0, elements = 0, number = 0;
  while (true) {
    const size_t end = file.find('\n', at);
    if (end == std::string_view::npos) ks::fail(KS_ERROR_FILE, "the PLY header does not end");
    const std::string line(file.substr(at, end - at));
    at = end + 1;
    const std::vector<std::string> words = words_of(line);
    if (words.empty()) ks::fail(KS_ERROR_FILE, "the PLY header has an empty line");
    if (number == 0 && words[0] != "ply") ks::fail(KS_ERROR_FILE, "this is not a PLY file");
    if (number == 1 && (words.size() != 3 || words[0] != "format")) ks::fail(KS_ERROR_FILE, "the PLY header has no format line");
    if (number > 1 && words[0] == "end_header") return;
    if (number > 1) check_ply_line(words, line, file.size(), elements);
    ++number;
  }
}

void check_collada(std::string_view file) {
  for (size_t at = file.find('<'); at != std::string_view::npos; at = file.find('<', at + 1)) {
    const bool comment = file.substr(at, 4) == "<!--";
    const size_t end = comment ? file.find("-->", at) : file.find('>', at);
    if (end == std::string_view::npos) ks::fail(KS_ERROR_FILE, "the XML ends inside a tag");
    if (comment) {
      at = end;
      continue;
    }
    const std::string_view tag = file.substr(at + 1, end - at - 1);
    const std::string_view name = tag.substr(0, tag.find_first_of(" \t\r\n/"));
    check_tag(tag, name, file.size());
    const std::string_view text = file.substr(end + 1, std::min(file.find('<', end), file.size()) - end - 1);
    if (std::find(collada_indices.begin(), collada_indices.end(), name) != collada_indices.end()) check_numbers<uint64_t>(text, name);
    if (std::find(collada_numbers.begin(), collada_numbers.end(), name) != collada_numbers.end()) check_numbers<double>(text, name);
  }
}

void check_read(const aiScene& file) {
  for (unsigned m = 0; m < file.mNumMeshes; ++m) {
    const aiMesh& mesh = *file.mMeshes[m];
    if (mesh.mMaterialIndex >= file.mNumMaterials)
      ks::fail(KS_ERROR_FILE, "mesh '%s' has material %u of %u", mesh.mName.C_Str(), mesh.mMaterialIndex, file.mNumMaterials);
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices == 0) ks::fail(KS_ERROR_FILE, "mesh '%s': face %u has no corners", mesh.mName.C_Str(), f);
      for (unsigned k = 0; k < face.mNumIndices; ++k)
        if (face.mIndices[k] >= mesh.mNumVertices)
          ks::fail(KS_ERROR_FILE, "mesh '%s': face %u uses vertex %u, but there are %u vertices", mesh.mName.C_Str(), f, face.mIndices[k],
                   mesh.mNumVertices);
    }
  }
}

}  // namespace kuafu
