#include "api/descriptors.h"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "api/fields.h"
#include "device/error.h"
#include "scene/matrix.h"
#include "scene/validate.h"

namespace kuafu {
namespace {

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

void from_twist(const Twist& twist, double* linear, double* angular) {
  for (int i = 0; i < 3; ++i) linear[i] = twist.linear[i], angular[i] = twist.angular[i];
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
  mesh.indices = array<glm::uvec3>(desc.indices, desc.triangle_count, "indices");
  mesh.slots = array<uint32_t>(desc.slots, desc.triangle_count);
  return mesh;
}

Texture to_texture(const kuafu_texture_desc& desc) {
  Texture texture;
  texture.name = text(desc.name);
  texture.width = desc.width;
  texture.height = desc.height;
  texture.channels = desc.channels;
  texture.format = to_format(desc.format);
  texture.srgb = desc.srgb != 0;
  texture.texels = array<uint8_t>(static_cast<const uint8_t*>(desc.texels), texel_bytes(texture), "texels");
  return texture;
}

Material to_material(const kuafu_material_desc& desc) {
  Material material;
  copy_fields(desc, material);
  return material;
}

Instance to_instance(const kuafu_instance_desc& desc) {
  Instance instance;
  instance.name = text(desc.name);
  instance.mesh = desc.mesh;
  instance.environment = desc.environment;
  instance.materials = array<uint32_t>(desc.materials, desc.material_count, "materials");
  instance.semantic_id = desc.semantic_id;
  instance.local_to_world = from_row_major<4>(desc.local_to_world);
  instance.velocity = to_twist(desc.linear_velocity, desc.angular_velocity);
  return instance;
}

Light to_light(const kuafu_light_desc& desc) {
  Light light;
  copy_fields(desc, light);
  light.velocity = to_twist(desc.linear_velocity, desc.angular_velocity);
  light.dots = {array<glm::vec3>(desc.dots, desc.dot_count, "dots"), desc.pattern_width, desc.pattern_height, desc.dot_sigma_px};
  return light;
}

Environment to_environment(const kuafu_environment_desc& desc) {
  Environment environment;
  copy_fields(desc, environment);
  return environment;
}

Medium to_medium(const kuafu_medium_desc& desc) {
  Medium medium;
  copy_fields(desc, medium);
  return medium;
}

Camera to_camera(const kuafu_camera_desc& desc) {
  Camera camera;
  camera.width = desc.width;
  camera.height = desc.height;
  camera.k = from_row_major<3>(desc.k);
  camera.camera_to_world = from_row_major<4>(desc.camera_to_world);
  camera.near_m = desc.near_m;
  camera.far_m = desc.far_m;
  std::copy(std::begin(desc.distortion), std::end(desc.distortion), camera.optics.distortion.begin());
  camera.optics.lens_radius_m = desc.lens_radius_m;
  camera.optics.focus_m = desc.focus_m;
  camera.shutter = {static_cast<Shutter::Kind>(desc.shutter), static_cast<Shutter::Readout>(desc.readout), desc.exposure_s,
                    desc.line_time_s};
  camera.velocity = to_twist(desc.linear_velocity, desc.angular_velocity);
  return camera;
}

kuafu_material_desc to_desc(const Material& material) {
  kuafu_material_desc desc = kuafu_material_desc_init();
  copy_fields(material, desc);
  return desc;
}

kuafu_light_desc to_desc(const Light& light) {
  kuafu_light_desc desc = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
  copy_fields(light, desc);
  from_twist(light.velocity, desc.linear_velocity, desc.angular_velocity);
  desc.dots = light.dots.dots.empty() ? nullptr : &light.dots.dots[0].x;
  desc.dot_count = uint32_t(light.dots.dots.size());
  desc.pattern_width = light.dots.width;
  desc.pattern_height = light.dots.height;
  desc.dot_sigma_px = light.dots.sigma_px;
  return desc;
}

kuafu_camera_desc to_desc(const Camera& camera) {
  kuafu_camera_desc desc = kuafu_camera_desc_init();
  desc.width = camera.width;
  desc.height = camera.height;
  to_row_major<3>(camera.k, desc.k);
  to_row_major<4>(camera.camera_to_world, desc.camera_to_world);
  desc.near_m = camera.near_m;
  desc.far_m = camera.far_m;
  std::ranges::copy(camera.optics.distortion, desc.distortion);
  desc.lens_radius_m = camera.optics.lens_radius_m;
  desc.focus_m = camera.optics.focus_m;
  desc.shutter = static_cast<uint32_t>(camera.shutter.kind);
  desc.readout = static_cast<uint32_t>(camera.shutter.readout);
  desc.exposure_s = camera.shutter.exposure_s;
  desc.line_time_s = camera.shutter.line_time_s;
  from_twist(camera.velocity, desc.linear_velocity, desc.angular_velocity);
  return desc;
}

}  // namespace kuafu
