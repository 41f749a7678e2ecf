// SPDX-License-Identifier: Apache-2.0
#include "api/descriptors.h"

#include <algorithm>
#include <cstring>

#include "device/error.h"
#include "scene/validate.h"

namespace kuafu {
namespace {

static_assert(uint32_t(Shutter::Kind::global) == KUAFU_SHUTTER_GLOBAL && uint32_t(Shutter::Kind::rolling) == KUAFU_SHUTTER_ROLLING);
static_assert(uint32_t(Shutter::Readout::rows_down) == KUAFU_READOUT_ROWS_DOWN &&
              uint32_t(Shutter::Readout::rows_up) == KUAFU_READOUT_ROWS_UP &&
              uint32_t(Shutter::Readout::columns_right) == KUAFU_READOUT_COLUMNS_RIGHT &&
              uint32_t(Shutter::Readout::columns_left) == KUAFU_READOUT_COLUMNS_LEFT);

std::string text(const char* name) { return name == nullptr ? "" : name; }

/// Copies `count` elements of N scalars each; NULL gives none, and is an error where the array must be there.
template <class T, class Scalar>
std::vector<T> array(const Scalar* from, size_t count, const char* required_name = nullptr) {
  if (from == nullptr && required_name != nullptr && count > 0)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is NULL, but %zu elements are announced", required_name, count);
  std::vector<T> out;
  if (from == nullptr) return out;
  out.resize(count);
  static_assert(sizeof(T) % sizeof(Scalar) == 0);
  if (count > 0) std::memcpy(static_cast<void*>(out.data()), from, count * sizeof(T));
  return out;
}

Texture::Format to_format(uint32_t format) {
  switch (format) {
    case KS_FORMAT_U8:
      return Texture::Format::u8;
    case KS_FORMAT_U16:
      return Texture::Format::u16;
    case KS_FORMAT_F32:
      return Texture::Format::f32;
    default:
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "texture format is %u, must be KS_FORMAT_U8, KS_FORMAT_U16 or KS_FORMAT_F32", format);
  }
}

}  // namespace

Twist to_twist(const double* linear, const double* angular) {
  return {{linear[0], linear[1], linear[2]}, {angular[0], angular[1], angular[2]}};
}

std::vector<glm::vec3> to_vectors(const float* values, uint32_t count) { return array<glm::vec3>(values, count); }

Mesh to_mesh(const kuafu_mesh_desc& desc) {
  Mesh mesh;
  mesh.name = text(desc.name);
  mesh.positions = array<glm::vec3>(desc.positions, desc.vertex_count, "positions");
  mesh.normals = to_vectors(desc.normals, desc.vertex_count);
  mesh.uvs = array<glm::vec2>(desc.uvs, desc.vertex_count);
  mesh.uvs_1 = array<glm::vec2>(desc.uvs_1, desc.vertex_count);
  mesh.colors = array<glm::vec4>(desc.colors, desc.vertex_count);
  mesh.indices = array<glm::uvec3>(desc.indices, desc.triangle_count, "indices");
  mesh.slots = array<uint32_t>(desc.slots, desc.triangle_count);
  return mesh;
}

Texture to_texture(const kuafu_texture_desc& desc) {
  Texture texture;
  copy_fields(desc, texture);
  texture.format = to_format(desc.format);
  texture.texels = array<uint8_t>(static_cast<const uint8_t*>(desc.texels), texel_bytes(texture), "texels");
  return texture;
}

Instance to_instance(const kuafu_instance_desc& desc) {
  Instance instance;
  copy_fields(desc, instance);
  instance.materials = array<uint32_t>(desc.materials, desc.material_count, "materials");
  for (uint32_t& material : instance.materials) --material;  // ids count from 1; none is 0xffffffff
  return instance;
}

Light to_light(const kuafu_light_desc& desc) {
  Light light;
  copy_fields(desc, light);
  light.dots.dots = array<glm::vec3>(desc.dots, desc.dot_count, "dots");
  return light;
}

kuafu_mesh_desc to_desc(const Mesh& mesh) {
  const auto first = [](const auto& array) { return array.empty() ? nullptr : &array[0].x; };
  kuafu_mesh_desc desc = kuafu_mesh_desc_init();
  desc.name = mesh.name.c_str();
  desc.positions = first(mesh.positions);
  desc.normals = first(mesh.normals);
  desc.uvs = first(mesh.uvs);
  desc.uvs_1 = first(mesh.uvs_1);
  desc.colors = first(mesh.colors);
  desc.indices = first(mesh.indices);
  desc.slots = mesh.slots.empty() ? nullptr : mesh.slots.data();
  desc.vertex_count = uint32_t(mesh.positions.size());
  desc.triangle_count = uint32_t(mesh.indices.size());
  return desc;
}

kuafu_texture_desc to_desc(const Texture& texture) {
  kuafu_texture_desc desc = kuafu_texture_desc_init();
  desc.name = texture.name.c_str();
  desc.texels = texture.texels.data();
  desc.width = texture.width, desc.height = texture.height, desc.channels = texture.channels;
  desc.format = texture.format == Texture::Format::u8    ? KS_FORMAT_U8
                : texture.format == Texture::Format::u16 ? KS_FORMAT_U16
                                                         : KS_FORMAT_F32;
  desc.srgb = texture.srgb;
  desc.wrap_u = texture.wrap_u, desc.wrap_v = texture.wrap_v, desc.filter = texture.filter, desc.uv_set = texture.uv_set;
  std::ranges::copy(texture.uv_transform, desc.uv_transform);
  return desc;
}

kuafu_instance_desc to_desc(const Instance& instance) {
  kuafu_instance_desc desc = kuafu_instance_desc_init(instance.mesh + 1);  // ids count from 1
  desc.name = instance.name.c_str();
  desc.environment = instance.environment;
  desc.semantic_id = instance.semantic_id;
  to_row_major(instance.local_to_world, desc.local_to_world);
  return desc;
}

kuafu_material_desc to_desc(const Material& material) {
  kuafu_material_desc desc = kuafu_material_desc_init();
  copy_fields(material, desc);
  return desc;
}

kuafu_light_desc to_desc(const Light& light) {
  kuafu_light_desc desc = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
  copy_fields(light, desc);
  desc.dots = light.dots.dots.empty() ? nullptr : &light.dots.dots[0].x;
  desc.dot_count = uint32_t(light.dots.dots.size());
  return desc;
}

kuafu_camera_desc to_desc(const Camera& camera) {
  kuafu_camera_desc desc = kuafu_camera_desc_init();
  copy_fields(camera, desc);
  return desc;
}

}  // namespace kuafu
