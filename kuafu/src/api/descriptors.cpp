#include "api/descriptors.h"

#include <algorithm>
#include <cstring>
#include <iterator>

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
  Material m;
  m.name = text(desc.name);
  for (int i = 0; i < 4; ++i) m.base_color[i] = desc.base_color[i];
  for (int i = 0; i < 3; ++i) m.emission[i] = desc.emission[i];
  m.metallic = desc.metallic;
  m.roughness = desc.roughness;
  m.specular = desc.specular;
  m.ior = desc.ior;
  m.transmission = desc.transmission;
  m.ir_albedo = desc.ir_albedo;
  m.ir_emission = desc.ir_emission;
  m.base_color_texture = desc.base_color_texture;
  m.metallic_roughness_texture = desc.metallic_roughness_texture;
  m.normal_texture = desc.normal_texture;
  m.emission_texture = desc.emission_texture;
  m.transmission_texture = desc.transmission_texture;
  m.specular_texture = desc.specular_texture;
  m.transmission_roughness = desc.transmission_roughness;
  m.diffuse_roughness = desc.diffuse_roughness;
  m.ir_attenuation_color = desc.ir_attenuation_color;
  m.attenuation_distance_m = desc.attenuation_distance_m;
  for (int i = 0; i < 3; ++i) m.attenuation_color[i] = desc.attenuation_color[i];
  m.bsdf = static_cast<Material::Bsdf>(desc.bsdf);
  m.light_group = desc.light_group;
  m.ior_texture = desc.ior_texture;
  m.ir_albedo_texture = desc.ir_albedo_texture;
  m.ir_roughness = desc.ir_roughness;
  m.ir_ior = desc.ir_ior;
  m.ir_transmission = desc.ir_transmission;
  m.ir_transmission_roughness = desc.ir_transmission_roughness;
  m.subsurface = desc.subsurface;
  for (int i = 0; i < 3; ++i) m.subsurface_color[i] = desc.subsurface_color[i];
  for (int i = 0; i < 3; ++i) m.subsurface_radius_m[i] = desc.subsurface_radius_m[i];
  m.ir_subsurface_color = desc.ir_subsurface_color;
  m.ir_subsurface_radius_m = desc.ir_subsurface_radius_m;
  m.thin_walled = desc.thin_walled != 0;
  return m;
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
  light.name = text(desc.name);
  light.kind = static_cast<Light::Kind>(desc.kind);
  light.environment = desc.environment;
  for (int i = 0; i < 3; ++i) light.intensity[i] = desc.intensity[i];
  light.ir_intensity = desc.ir_intensity;
  light.light_to_world = from_row_major<4>(desc.light_to_world);
  light.texture = desc.texture;
  light.k = from_row_major<3>(desc.k);
  light.radius_m = desc.radius_m;
  light.angle_rad = desc.angle_rad;
  light.inner_rad = desc.inner_rad;
  light.outer_rad = desc.outer_rad;
  light.size_m = {desc.size_m[0], desc.size_m[1]};
  std::copy(std::begin(desc.distortion), std::end(desc.distortion), light.distortion);
  light.falloff = desc.falloff;
  light.focus_m = desc.focus_m;
  light.velocity = to_twist(desc.linear_velocity, desc.angular_velocity);
  light.on_from_s = desc.on_from_s;
  light.on_until_s = desc.on_until_s;
  light.pattern_scale = desc.pattern_scale;
  light.dots = {array<glm::vec3>(desc.dots, desc.dot_count, "dots"), desc.pattern_width, desc.pattern_height, desc.dot_sigma_px};
  light.light_group = desc.light_group;
  return light;
}

Environment to_environment(const kuafu_environment_desc& desc) {
  Environment environment;
  environment.radiance = {desc.radiance[0], desc.radiance[1], desc.radiance[2]};
  environment.ir_radiance = desc.ir_radiance;
  environment.texture = desc.texture;
  environment.light_group = desc.light_group;
  environment.map_to_world = from_row_major<3>(desc.map_to_world);
  return environment;
}

Medium to_medium(const kuafu_medium_desc& desc) {
  Medium medium;
  for (int i = 0; i < 3; ++i) {
    medium.extinction_per_m[i] = desc.extinction_per_m[i];
    medium.albedo[i] = desc.albedo[i];
    medium.bounds_min_m[i] = desc.bounds_min_m[i];
    medium.bounds_max_m[i] = desc.bounds_max_m[i];
  }
  medium.ir_extinction_per_m = desc.ir_extinction_per_m;
  medium.ir_albedo = desc.ir_albedo;
  medium.phase_g = desc.phase_g;
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

kuafu_material_desc to_desc(const Material& m) {
  kuafu_material_desc desc = kuafu_material_desc_init();
  desc.name = m.name.c_str();
  for (int i = 0; i < 4; ++i) desc.base_color[i] = m.base_color[i];
  for (int i = 0; i < 3; ++i) desc.emission[i] = m.emission[i];
  desc.metallic = m.metallic;
  desc.roughness = m.roughness;
  desc.specular = m.specular;
  desc.ior = m.ior;
  desc.transmission = m.transmission;
  desc.ir_albedo = m.ir_albedo;
  desc.ir_emission = m.ir_emission;
  desc.base_color_texture = m.base_color_texture;
  desc.metallic_roughness_texture = m.metallic_roughness_texture;
  desc.normal_texture = m.normal_texture;
  desc.emission_texture = m.emission_texture;
  desc.transmission_texture = m.transmission_texture;
  desc.specular_texture = m.specular_texture;
  desc.transmission_roughness = m.transmission_roughness;
  desc.diffuse_roughness = m.diffuse_roughness;
  desc.ir_attenuation_color = m.ir_attenuation_color;
  desc.attenuation_distance_m = m.attenuation_distance_m;
  for (int i = 0; i < 3; ++i) desc.attenuation_color[i] = m.attenuation_color[i];
  desc.bsdf = static_cast<uint32_t>(m.bsdf);
  desc.light_group = m.light_group;
  desc.ior_texture = m.ior_texture;
  desc.ir_albedo_texture = m.ir_albedo_texture;
  desc.ir_roughness = m.ir_roughness;
  desc.ir_ior = m.ir_ior;
  desc.ir_transmission = m.ir_transmission;
  desc.ir_transmission_roughness = m.ir_transmission_roughness;
  desc.subsurface = m.subsurface;
  for (int i = 0; i < 3; ++i) desc.subsurface_color[i] = m.subsurface_color[i];
  for (int i = 0; i < 3; ++i) desc.subsurface_radius_m[i] = m.subsurface_radius_m[i];
  desc.ir_subsurface_color = m.ir_subsurface_color;
  desc.ir_subsurface_radius_m = m.ir_subsurface_radius_m;
  desc.thin_walled = m.thin_walled ? 1 : 0;
  return desc;
}

kuafu_light_desc to_desc(const Light& light) {
  kuafu_light_desc desc = kuafu_light_desc_init(static_cast<uint32_t>(light.kind));
  desc.name = light.name.c_str();
  desc.environment = light.environment;
  for (int i = 0; i < 3; ++i) desc.intensity[i] = light.intensity[i];
  desc.ir_intensity = light.ir_intensity;
  to_row_major<4>(light.light_to_world, desc.light_to_world);
  desc.texture = light.texture;
  to_row_major<3>(light.k, desc.k);
  desc.radius_m = light.radius_m;
  desc.angle_rad = light.angle_rad;
  desc.inner_rad = light.inner_rad;
  desc.outer_rad = light.outer_rad;
  for (int i = 0; i < 2; ++i) desc.size_m[i] = light.size_m[i];
  std::copy(std::begin(light.distortion), std::end(light.distortion), desc.distortion);
  desc.falloff = light.falloff;
  desc.focus_m = light.focus_m;
  from_twist(light.velocity, desc.linear_velocity, desc.angular_velocity);
  desc.on_from_s = light.on_from_s;
  desc.on_until_s = light.on_until_s;
  desc.pattern_scale = light.pattern_scale;
  desc.dots = light.dots.dots.empty() ? nullptr : &light.dots.dots[0].x;
  desc.dot_count = uint32_t(light.dots.dots.size());
  desc.pattern_width = light.dots.width;
  desc.pattern_height = light.dots.height;
  desc.dot_sigma_px = light.dots.sigma_px;
  desc.light_group = light.light_group;
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
