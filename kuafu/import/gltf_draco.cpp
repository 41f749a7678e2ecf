// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_draco.h"

#include <draco/compression/decode.h>

#include "device/error.h"
#include "import/gltf_accessor.h"

namespace kuafu {
namespace {

constexpr const char* draco_extension = "KHR_draco_mesh_compression";

const draco::PointAttribute* attribute_of(const draco::Mesh& mesh, const tinygltf::Value& ids, const std::string& name) {
  if (!ids.IsObject() || !ids.Has(name) || !ids.Get(name).IsNumber()) return nullptr;
  const int id = ids.Get(name).GetNumberAsInt();
  return id < 0 ? nullptr : mesh.GetAttributeByUniqueId(static_cast<uint32_t>(id));
}

}  // namespace

DracoPrimitive::DracoPrimitive(std::unique_ptr<draco::Mesh> mesh, const tinygltf::Value& attributes)
    : mesh_(std::move(mesh)), attributes_(attributes) {}
DracoPrimitive::~DracoPrimitive() = default;
DracoPrimitive::DracoPrimitive(DracoPrimitive&&) noexcept = default;
DracoPrimitive& DracoPrimitive::operator=(DracoPrimitive&&) noexcept = default;

std::optional<DracoPrimitive> DracoPrimitive::decode(Budget& budget, const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                                     const std::string& field) {
  const auto found = primitive.extensions.find(draco_extension);
  if (found == primitive.extensions.end()) return std::nullopt;
  const tinygltf::Value& extension = found->second;
  const std::string user = field + ".extensions." + draco_extension;
  if (!extension.Has("bufferView") || !extension.Get("bufferView").IsNumber() || !extension.Has("attributes"))
    ks::fail(KS_ERROR_FILE, "%s needs a bufferView and attributes", user.c_str());
  const Bytes bytes = view_bytes(model, extension.Get("bufferView").GetNumberAsInt(), user);
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data), bytes.size);
  draco::Decoder decoder;
  auto result = decoder.DecodeMeshFromBuffer(&buffer);
  if (!result.ok()) ks::fail(KS_ERROR_FILE, "%s cannot be decoded: %.200s", user.c_str(), result.status().error_msg());
  std::unique_ptr<draco::Mesh> mesh = std::move(result).value();
  budget.claim(uint64_t{mesh->num_faces()} * 12, user);
  return DracoPrimitive(std::move(mesh), extension.Get("attributes"));
}

bool DracoPrimitive::has(const std::string& attribute) const { return attribute_of(*mesh_, attributes_, attribute) != nullptr; }

int DracoPrimitive::components(const std::string& attribute) const {
  const draco::PointAttribute* const from = attribute_of(*mesh_, attributes_, attribute);
  return from == nullptr ? 0 : from->num_components();
}

std::vector<float> DracoPrimitive::floats(const std::string& attribute, int components, const std::string& field) const {
  const draco::PointAttribute* const from = attribute_of(*mesh_, attributes_, attribute);
  if (from == nullptr || from->num_components() != components)
    ks::fail(KS_ERROR_FILE, "%s has %d components in its Draco data, must be %d", field.c_str(),
             from == nullptr ? 0 : static_cast<int>(from->num_components()), components);
  std::vector<float> out(size_t{mesh_->num_points()} * static_cast<size_t>(components));
  for (uint32_t i = 0; i < mesh_->num_points(); ++i) {
    const draco::AttributeValueIndex value = from->mapped_index(draco::PointIndex(i));
    if (value.value() >= from->size() ||
        !from->ConvertValue(value, static_cast<int8_t>(components), &out[size_t{i} * static_cast<size_t>(components)]))
      ks::fail(KS_ERROR_FILE, "%s: its Draco data has no value for vertex %u", field.c_str(), i);
  }
  return out;
}

std::vector<uint32_t> DracoPrimitive::indices() const {
  std::vector<uint32_t> out;
  out.reserve(size_t{mesh_->num_faces()} * 3);
  for (uint32_t i = 0; i < mesh_->num_faces(); ++i)
    for (const draco::PointIndex& point : mesh_->face(draco::FaceIndex(i))) out.push_back(point.value());
  return out;
}

}  // namespace kuafu
