// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_accessor.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "device/error.h"

namespace kuafu {
namespace {

// An accessor without a buffer view is all zeros and costs the file nothing: this bounds what such a file can make us allocate.
constexpr size_t max_zero_elements = size_t{1} << 20;

template <class T>
T load(const uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

/// Normalisation as in glTF 2.0 section 3.6.2.2.
template <class T>
float to_float(T value, bool normalized) {
  if (!normalized) return static_cast<float>(value);
  return std::max(static_cast<float>(value) / static_cast<float>(std::numeric_limits<T>::max()), -1.0f);
}

float load_float(const uint8_t* at, int component_type, bool normalized) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return to_float(load<int8_t>(at), normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return to_float(load<uint8_t>(at), normalized);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return to_float(load<int16_t>(at), normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return to_float(load<uint16_t>(at), normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return to_float(load<uint32_t>(at), normalized);
    default:
      return load<float>(at);
  }
}

uint32_t load_index(const uint8_t* at, int component_type) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load<uint8_t>(at);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<uint16_t>(at);
    default:
      return load<uint32_t>(at);
  }
}

size_t component_bytes(int component_type, bool index, const std::string& field) {
  constexpr std::array allowed{TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT,
                               TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT,  TINYGLTF_COMPONENT_TYPE_BYTE,
                               TINYGLTF_COMPONENT_TYPE_SHORT,         TINYGLTF_COMPONENT_TYPE_FLOAT};
  const auto end = allowed.begin() + (index ? 3 : 6);  // indices are unsigned
  if (std::find(allowed.begin(), end, component_type) == end)
    ks::fail(KS_ERROR_FILE, "%s: component type %d is not allowed here", field.c_str(), component_type);
  return static_cast<size_t>(tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(component_type)));
}

/// Element i stands at data + i * stride; all `count` elements of `element_bytes` are inside the view.
struct Elements {
  const uint8_t* data;
  size_t stride;
};
Elements elements(const tinygltf::Model& model, int view, size_t offset, size_t count, size_t element_bytes, const std::string& field) {
  const Bytes bytes = view_bytes(model, view, field);
  const size_t stride = bytes.stride == 0 ? element_bytes : bytes.stride;
  if (stride < element_bytes)
    ks::fail(KS_ERROR_FILE, "%s: byteStride %zu is less than an element of %zu bytes", field.c_str(), stride, element_bytes);
  const bool fits = offset <= bytes.size && element_bytes <= bytes.size - offset &&
                    (count == 0 || (count - 1) <= (bytes.size - offset - element_bytes) / stride);
  if (count > 0 && !fits)
    ks::fail(KS_ERROR_FILE, "%s: %zu elements of %zu bytes at byte %zu, stride %zu, end beyond their buffer view of %zu bytes",
             field.c_str(), count, element_bytes, offset, stride, bytes.size);
  return {bytes.data + std::min(offset, bytes.size), stride};
}

const tinygltf::Accessor& accessor_at(const tinygltf::Model& model, int index, const std::string& field) {
  if (index < 0 || static_cast<size_t>(index) >= model.accessors.size())
    ks::fail(KS_ERROR_FILE, "%s: accessor %d of %zu", field.c_str(), index, model.accessors.size());
  return model.accessors[static_cast<size_t>(index)];
}

void check_components(const tinygltf::Accessor& accessor, int components, const std::string& field) {
  const int found = tinygltf::GetNumComponentsInType(static_cast<uint32_t>(accessor.type));
  if (found != components) ks::fail(KS_ERROR_FILE, "%s has %d components per element, must be %d", field.c_str(), found, components);
}

/// Overwrites the elements that a sparse accessor lists (glTF 2.0 section 3.6.2.3).
void substitute(const tinygltf::Model& model, const tinygltf::Accessor& accessor, size_t components, size_t bytes,
                std::vector<float>& values, const std::string& field) {
  const auto& sparse = accessor.sparse;
  const int index_type = sparse.indices.componentType;
  const size_t count = static_cast<size_t>(std::max(sparse.count, 0)), index_bytes = component_bytes(index_type, true, field);
  const Elements at = elements(model, sparse.indices.bufferView, static_cast<size_t>(sparse.indices.byteOffset), count, index_bytes,
                               field + ".sparse.indices");
  const Elements from = elements(model, sparse.values.bufferView, static_cast<size_t>(sparse.values.byteOffset), count, components * bytes,
                                 field + ".sparse.values");
  for (size_t i = 0; i < count; ++i) {
    const size_t element = load_index(at.data + i * at.stride, index_type);
    if (element >= accessor.count) ks::fail(KS_ERROR_FILE, "%s.sparse: index %zu of %zu elements", field.c_str(), element, accessor.count);
    for (size_t c = 0; c < components; ++c)
      values[element * components + c] = load_float(from.data + i * from.stride + c * bytes, accessor.componentType, accessor.normalized);
  }
}

}  // namespace

Bytes view_bytes(const tinygltf::Model& model, int view, const std::string& field) {
  if (view < 0 || static_cast<size_t>(view) >= model.bufferViews.size())
    ks::fail(KS_ERROR_FILE, "%s: buffer view %d of %zu", field.c_str(), view, model.bufferViews.size());
  const tinygltf::BufferView& v = model.bufferViews[static_cast<size_t>(view)];
  if (v.buffer < 0 || static_cast<size_t>(v.buffer) >= model.buffers.size())
    ks::fail(KS_ERROR_FILE, "%s: buffer %d of %zu", field.c_str(), v.buffer, model.buffers.size());
  const std::vector<unsigned char>& data = model.buffers[static_cast<size_t>(v.buffer)].data;
  if (v.byteOffset > data.size() || v.byteLength > data.size() - v.byteOffset)
    ks::fail(KS_ERROR_FILE, "%s: buffer view %d ends beyond its buffer of %zu bytes", field.c_str(), view, data.size());
  return {data.data() + v.byteOffset, v.byteLength, v.byteStride};
}

std::vector<float> read_floats(Budget& budget, const tinygltf::Model& model, int index, int components, const std::string& field) {
  const tinygltf::Accessor& accessor = accessor_at(model, index, field);
  check_components(accessor, components, field);
  const size_t width = static_cast<size_t>(components), bytes = component_bytes(accessor.componentType, false, field);
  const bool zeros = accessor.bufferView < 0;
  if (zeros && accessor.count > max_zero_elements)
    ks::fail(KS_ERROR_FILE, "%s: %zu elements without a buffer view", field.c_str(), accessor.count);
  Elements from{nullptr, 0};
  if (!zeros) from = elements(model, accessor.bufferView, accessor.byteOffset, accessor.count, width * bytes, field);
  budget.claim(accessor.count * width * sizeof(float), field);
  std::vector<float> values(accessor.count * width, 0.0f);
  if (!zeros)
    for (size_t i = 0; i < accessor.count; ++i)
      for (size_t c = 0; c < width; ++c)
        values[i * width + c] = load_float(from.data + i * from.stride + c * bytes, accessor.componentType, accessor.normalized);
  if (accessor.sparse.isSparse) substitute(model, accessor, width, bytes, values, field);
  return values;
}

std::vector<uint32_t> read_indices(Budget& budget, const tinygltf::Model& model, int index, const std::string& field) {
  const tinygltf::Accessor& accessor = accessor_at(model, index, field);
  check_components(accessor, 1, field);
  if (accessor.sparse.isSparse) ks::fail(KS_ERROR_UNSUPPORTED, "%s: sparse indices are not read", field.c_str());
  const size_t bytes = component_bytes(accessor.componentType, true, field);
  const Elements from = elements(model, accessor.bufferView, accessor.byteOffset, accessor.count, bytes, field);
  budget.claim(accessor.count * sizeof(uint32_t), field);
  std::vector<uint32_t> values(accessor.count);
  for (size_t i = 0; i < values.size(); ++i) values[i] = load_index(from.data + i * from.stride, accessor.componentType);
  return values;
}

}  // namespace kuafu
