// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_document.h"

#include <meshoptimizer.h>

#include "device/error.h"
#include "import/gltf_accessor.h"

namespace kuafu {
namespace {

constexpr const char* meshopt_extension = "EXT_meshopt_compression";

/// The extension's object of a buffer view.
struct Compressed {
  size_t count = 0, stride = 0;
  std::string mode, filter;
};

size_t size_of(const tinygltf::Value& e, const char* key) {
  return e.Has(key) && e.Get(key).IsNumber() ? static_cast<size_t>(e.Get(key).GetNumberAsDouble()) : 0;
}

std::string text_of(const tinygltf::Value& e, const char* key, const char* fallback) {
  return e.Has(key) && e.Get(key).IsString() ? e.Get(key).Get<std::string>() : fallback;
}

/// The sizes that the extension's specification allows, which the library takes for granted.
void check(const Compressed& c, size_t view_stride, const std::string& field) {
  const bool vertices = c.mode == "ATTRIBUTES", triangles = c.mode == "TRIANGLES";
  if (!vertices && !triangles && c.mode != "INDICES")
    ks::fail(KS_ERROR_FILE, "%s.mode is '%.20s', must be ATTRIBUTES, TRIANGLES or INDICES", field.c_str(), c.mode.c_str());
  const bool fits = vertices ? c.stride > 0 && c.stride % 4 == 0 && c.stride <= 256 : c.stride == 2 || c.stride == 4;
  if (!fits || (view_stride != 0 && view_stride != c.stride))
    ks::fail(KS_ERROR_FILE, "%s.byteStride is %zu, which mode %s does not allow, or not that of its buffer view", field.c_str(), c.stride,
             c.mode.c_str());
  if (triangles && c.count % 3 != 0)
    ks::fail(KS_ERROR_FILE, "%s.count is %zu, which is no whole number of triangles", field.c_str(), c.count);
  const bool filter_fits = c.filter == "NONE" || (vertices && ((c.filter == "OCTAHEDRAL" && (c.stride == 4 || c.stride == 8)) ||
                                                               (c.filter == "QUATERNION" && c.stride == 8) || c.filter == "EXPONENTIAL"));
  if (!filter_fits)
    ks::fail(KS_ERROR_FILE, "%s.filter is '%.20s', which does not go with mode %s and %zu bytes for each element", field.c_str(),
             c.filter.c_str(), c.mode.c_str(), c.stride);
}

bool decode(const Compressed& c, const Bytes& from, std::vector<unsigned char>& to) {
  int error = 0;
  if (c.mode == "ATTRIBUTES") error = meshopt_decodeVertexBuffer(to.data(), c.count, c.stride, from.data, from.size);
  if (c.mode == "TRIANGLES") error = meshopt_decodeIndexBuffer(to.data(), c.count, c.stride, from.data, from.size);
  if (c.mode == "INDICES") error = meshopt_decodeIndexSequence(to.data(), c.count, c.stride, from.data, from.size);
  if (error != 0) return false;
  if (c.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(to.data(), c.count, c.stride);
  if (c.filter == "QUATERNION") meshopt_decodeFilterQuat(to.data(), c.count, c.stride);
  if (c.filter == "EXPONENTIAL") meshopt_decodeFilterExp(to.data(), c.count, c.stride);
  return true;
}

void decode_view(Budget& budget, tinygltf::Model& model, size_t index, const tinygltf::Value& e) {
  const std::string field = "bufferViews[" + std::to_string(index) + "].extensions." + meshopt_extension;
  const Compressed c{.count = size_of(e, "count"),
                     .stride = size_of(e, "byteStride"),
                     .mode = text_of(e, "mode", ""),
                     .filter = text_of(e, "filter", "NONE")};
  const Bytes from = view_bytes(model, static_cast<int>(index), field);
  check(c, from.stride, field);
  budget.claim(uint64_t{c.count} * c.stride, field);
  tinygltf::Buffer decoded;
  decoded.data.resize(c.count * c.stride);
  if (!decode(c, from, decoded.data))
    ks::fail(KS_ERROR_FILE, "%s: its %zu bytes are no %zu compressed elements of %zu bytes", field.c_str(), from.size, c.count, c.stride);
  tinygltf::BufferView& view = model.bufferViews[index];
  view.buffer = static_cast<int>(model.buffers.size());
  view.byteOffset = 0;
  view.byteLength = decoded.data.size();
  model.buffers.push_back(std::move(decoded));
}

}  // namespace

bool read_compressed_views(nlohmann::json& root) {
  const nlohmann::json::json_pointer extension(std::string("/extensions/") + meshopt_extension);
  bool changed = false;
  if (root.contains("bufferViews"))
    for (auto& view : root["bufferViews"]) {
      if (!view.contains(extension)) continue;
      const nlohmann::json& e = view.at(extension);
      for (const char* key : {"buffer", "byteLength"})
        if (!e.contains(key)) ks::fail(KS_ERROR_FILE, "bufferViews: %s.%s is missing", meshopt_extension, key);
      view["buffer"] = e["buffer"];
      view["byteOffset"] = e.value("byteOffset", uint64_t{0});
      view["byteLength"] = e["byteLength"];
      changed = true;
    }
  return changed;
}

void decode_meshopt(Budget& budget, tinygltf::Model& model) {
  for (size_t i = 0; i < model.bufferViews.size(); ++i) {
    const auto found = model.bufferViews[i].extensions.find(meshopt_extension);
    if (found != model.bufferViews[i].extensions.end()) decode_view(budget, model, i, found->second);
  }
}

}  // namespace kuafu
