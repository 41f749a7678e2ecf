// SPDX-License-Identifier: Apache-2.0
#define TINYGLTF_IMPLEMENTATION
#include "import/gltf_document.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <set>
#include <string_view>

#include "device/error.h"
#include "import/gltf_schema.h"

namespace kuafu {
namespace {

// Requests reach these as base directory + "/" + decoded URI, or as "./" + URI, which is refused: a file never means the working directory.
// The base directory is a word of ours, so that what follows it is what the file says.
constexpr std::string_view base_directory = "scene:";

bool file_exists(const std::string& name, void*) { return name.starts_with(base_directory); }

std::string same_path(const std::string& name, void*) { return name; }

bool read_file(std::vector<unsigned char>* out, std::string* error, const std::string& name, void* user) {
  try {
    *out = static_cast<const SceneFolder*>(user)->read(name.substr(base_directory.size() + 1));
    return true;
  } catch (const ks::Error& e) {
    *error = e.what();
    return false;
  }
}

/// Keeps what a data URI held for later decoding. For an image in a buffer view the bytes are not checked yet: they are not touched.
bool keep_encoded(tinygltf::Image* image, int, std::string*, std::string*, int, int, const unsigned char* bytes, int size, void*) {
  if (image->bufferView < 0) image->image.assign(bytes, bytes + size);
  return true;
}

uint32_t word(const std::vector<uint8_t>& bytes, size_t offset) {
  uint32_t value;
  std::memcpy(&value, bytes.data() + offset, 4);
  return value;
}

bool is_binary(const std::vector<uint8_t>& bytes) { return bytes.size() >= 4 && std::memcmp(bytes.data(), "glTF", 4) == 0; }

/// The JSON chunk of a .glb (glTF 2.0 section 4.4); every chunk must lie inside the file.
std::string_view binary_json(const std::vector<uint8_t>& bytes) {
  constexpr uint32_t json_chunk = 0x4e4f534au;
  if (bytes.size() < 20) ks::fail(KS_ERROR_FILE, "%zu bytes are too short for a glb header", bytes.size());
  if (word(bytes, 4) != 2) ks::fail(KS_ERROR_UNSUPPORTED, "glb version is %u, only 2 is read", word(bytes, 4));
  const uint64_t length = word(bytes, 8), json_bytes = word(bytes, 12);
  if (length > bytes.size())
    ks::fail(KS_ERROR_FILE, "the glb header says %zu bytes, the file has %zu: it is truncated", static_cast<size_t>(length), bytes.size());
  if (word(bytes, 16) != json_chunk || 20 + json_bytes > length)
    ks::fail(KS_ERROR_FILE, "the glb's first chunk is not a JSON chunk inside the file");
  const uint64_t chunk = 20 + json_bytes;
  if (chunk + 8 <= length && chunk + 8 + word(bytes, chunk) > length)
    ks::fail(KS_ERROR_FILE, "the glb's second chunk (%u bytes) ends beyond the file", word(bytes, chunk));
  return {reinterpret_cast<const char*>(bytes.data()) + 20, static_cast<size_t>(json_bytes)};
}

/// tinygltf reads '+' in a buffer's URI as a space. Returns true where something had to be escaped.
bool escape_plus(nlohmann::json& root) {
  bool changed = false;
  if (!root.contains("buffers")) return false;
  for (auto& buffer : root["buffers"]) {
    if (!buffer.contains("uri")) continue;
    std::string uri = buffer["uri"];
    if (uri.rfind("data:", 0) == 0) continue;
    for (size_t at = uri.find('+'); at != std::string::npos; at = uri.find('+', at)) uri.replace(at, 1, "%2B"), changed = true;
    buffer["uri"] = uri;
  }
  return changed;
}

/// A buffer that no view reads needs no bytes: EXT_meshopt_compression has one for those who cannot decode, with a flag or without.
/// tinygltf wants some. Returns true where a buffer got them.
bool fill_unread_buffers(nlohmann::json& root, bool binary) {
  if (!root.contains("buffers")) return false;
  bool changed = false;
  std::set<uint64_t> read;
  if (root.contains("bufferViews"))
    for (const auto& view : root["bufferViews"]) read.insert(view.value("buffer", uint64_t{0}));
  for (size_t i = binary ? 1 : 0; i < root["buffers"].size(); ++i) {
    auto& buffer = root["buffers"][i];
    if (buffer.contains("uri")) continue;
    if (read.contains(i)) ks::fail(KS_ERROR_FILE, "buffers[%zu] has no uri: the file has no bytes for it, export it with its buffers", i);
    buffer["uri"] = "data:application/octet-stream;base64,AA==";
    buffer["byteLength"] = 1;
    changed = true;
  }
  return changed;
}

/// tinygltf refuses an index accessor without a buffer view, which is what a primitive has whose triangles are compressed (gltf_draco.h).
/// Returns true where one was taken out.
bool drop_compressed_indices(nlohmann::json& root) {
  bool changed = false;
  if (!root.contains("meshes")) return false;
  for (auto& mesh : root["meshes"]) {
    if (!mesh.contains("primitives")) continue;
    for (auto& primitive : mesh["primitives"])
      if (primitive.contains(nlohmann::json::json_pointer("/extensions/KHR_draco_mesh_compression")))
        changed = primitive.erase("indices") > 0 || changed;
  }
  return changed;
}

/// A .glb with another text in its JSON chunk, and its other chunks as they are.
std::vector<uint8_t> with_json(const std::vector<uint8_t>& glb, std::string text) {
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const size_t rest = 20 + size_t{word(glb, 12)}, end = word(glb, 8);
  std::vector<uint8_t> out(glb.begin(), glb.begin() + 20);
  out.insert(out.end(), text.begin(), text.end());
  out.insert(out.end(), glb.begin() + static_cast<long>(rest), glb.begin() + static_cast<long>(end));
  const std::array<uint32_t, 2> sizes{static_cast<uint32_t>(out.size()), static_cast<uint32_t>(text.size())};
  std::memcpy(out.data() + 8, sizes.data(), sizeof sizes);
  return out;
}

std::string one_line(std::string text) {
  const std::string base = std::string(base_directory) + "/";
  for (size_t at = text.find(base); at != std::string::npos; at = text.find(base, at)) text.erase(at, base.size());
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text.empty() ? "tinygltf gives no reason" : text;
}

void clean_names(tinygltf::Model& model) {
  const auto clean = [](auto& table) {
    for (auto& entry : table) entry.name = clean_name(entry.name);
  };
  clean(model.nodes), clean(model.meshes), clean(model.materials), clean(model.images), clean(model.cameras), clean(model.lights);
  clean(model.animations);
}

}  // namespace

tinygltf::Model read_gltf(Import& import) {
  std::vector<uint8_t> bytes = import.folder.read_scene_file();
  if (bytes.size() > 0xffffffffu) ks::fail(KS_ERROR_UNSUPPORTED, "%zu bytes: a glTF file must be smaller than 4 GiB", bytes.size());
  const bool binary = is_binary(bytes);
  std::string text(binary ? binary_json(bytes) : std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  nlohmann::json root = parse_gltf_json(text);
  warn_of_unknown_members(import, root);
  const bool dropped = drop_compressed_indices(root), compressed = read_compressed_views(root), filled = fill_unread_buffers(root, binary),
             escaped = !binary && escape_plus(root);
  if (dropped || compressed || filled || escaped) text = root.dump();
  if (binary && (dropped || compressed || filled)) bytes = with_json(bytes, text);

  const std::string directory(base_directory);
  tinygltf::TinyGLTF reader;
  reader.SetFsCallbacks({file_exists, same_path, read_file, nullptr, &import.folder});
  reader.SetImageLoader(keep_encoded, nullptr);
  tinygltf::Model model;
  std::string error, warning;
  bool good = false;
  try {
    good = binary ? reader.LoadBinaryFromMemory(&model, &error, &warning, bytes.data(), static_cast<unsigned>(bytes.size()), directory)
                  : reader.LoadASCIIFromString(&model, &error, &warning, text.data(), static_cast<unsigned>(text.size()), directory);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    error += e.what();
  }
  if (!good) ks::fail(KS_ERROR_FILE, "%s", one_line(error).c_str());
  clean_names(model);
  decode_meshopt(import.budget, model);
  return model;
}

std::string decode_uri(const std::string& uri) {
  std::string out;
  for (size_t i = 0; i < uri.size(); ++i) {
    const auto hex = [&](size_t at) { return at < uri.size() && std::isxdigit(static_cast<unsigned char>(uri[at])); };
    if (uri[i] == '%' && hex(i + 1) && hex(i + 2)) {
      out += static_cast<char>(std::stoi(uri.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      out += uri[i];
    }
  }
  return out;
}

}  // namespace kuafu
