// SPDX-License-Identifier: Apache-2.0
#include "import/assimp_guard.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <sstream>
#include <string>
#include <vector>

#include "device/error.h"
#include "import/plain_text.h"

namespace kuafu {
namespace {

constexpr size_t most_header_lines = 1000;  // assimp compares every property with every other
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
    if (number > most_header_lines) ks::fail(KS_ERROR_FILE, "the PLY header has more than %zu lines", most_header_lines);
    if (number > 1) check_ply_line(words, line, file.size(), elements);
    ++number;
  }
}

std::vector<uint8_t> guarded_mtl(const std::vector<uint8_t>& file, const std::function<void(const std::string&)>& left_out) {
  std::string_view rest(reinterpret_cast<const char*>(file.data()), file.size());
  for (uint64_t number = 1; !rest.empty(); ++number) {
    const std::string_view here = rest;
    std::string_view words = take_line(rest);
    const std::string_view name = take_word(words);
    if (name == "newmtl") return {here.begin(), here.end()};
    if (name.empty() || name[0] == '#') continue;
    left_out("line " + std::to_string(number) + ": '" + std::string(name.substr(0, 40)) + "' stands before any newmtl and is left out");
  }
  return {};
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
