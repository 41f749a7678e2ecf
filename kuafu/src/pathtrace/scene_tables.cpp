#include "pathtrace/scene_tables.h"

#include <algorithm>
#include <cmath>

#include "material/specular_albedo.h"

namespace kuafu {
namespace {

// Beer and Lambert: white light has this colour after the given distance. Black would be opaque; its stand-in lets e^-20 through.
float attenuation(float color, float distance_m) { return distance_m > 0.0f ? -std::log(std::max(color, 2e-9f)) / distance_m : 0.0f; }

MaterialRecord record_of(const Material& m, uint32_t id) {
  MaterialRecord r{};
  r.base_color = glm::vec3(m.base_color);
  r.metallic = m.metallic;
  r.roughness = m.roughness;
  r.specular = m.specular;
  r.ior = m.ior;
  r.transmission = m.transmission;
  r.emission = m.emission;
  const bool from_colour = std::isnan(m.ir_albedo);
  r.ir_albedo = from_colour ? m.base_color.r : m.ir_albedo;
  r.ir_emission = m.ir_emission;
  r.id = id;
  for (int i = 0; i < 3; ++i) r.attenuation[i] = attenuation(m.attenuation_color[i], m.attenuation_distance_m);
  r.ir_attenuation = std::isnan(m.ir_attenuation_color) ? r.attenuation.r : attenuation(m.ir_attenuation_color, m.attenuation_distance_m);
  r.transmission_roughness = m.transmission_roughness;
  r.diffuse_roughness = m.diffuse_roughness;
  r.coat = m.bsdf == Material::Bsdf::paper ? 0.0f : 1.0f;
  r.light_group = m.light_group;
  r.base_color_texture = m.base_color_texture;
  r.ir_albedo_texture = from_colour ? m.base_color_texture : no_texture;
  r.metallic_roughness_texture = m.metallic_roughness_texture;
  r.normal_texture = m.normal_texture;
  r.emission_texture = m.emission_texture;
  r.transmission_texture = m.transmission_texture;
  r.specular_texture = m.specular_texture;
  for (const uint32_t t : {r.base_color_texture, r.metallic_roughness_texture, r.normal_texture, r.emission_texture, r.transmission_texture,
                           r.specular_texture})
    if (t != no_texture) r.textured = 1;
  return r;
}

Material grey_default() {
  Material m;
  m.base_color = glm::vec4(0.5f, 0.5f, 0.5f, 1.0f);
  m.specular = 0.0f;
  return m;
}

void set_transform(InstanceRecord& record, const glm::dmat4& local_to_world) {
  const glm::dmat4 rows = glm::transpose(local_to_world);
  const glm::dmat3 linear(local_to_world);
  // Columns of the inverse are rows of its transpose; scaled so that a normal stays in range whatever the instance's scale.
  const glm::dmat3 inverse = glm::inverse(linear);
  double largest = 0;
  for (int c = 0; c < 3; ++c) largest = std::max(largest, glm::length(inverse[c]));
  const double scale = std::isfinite(largest) && largest > 0 ? 1 / largest : 1;
  const glm::dmat3 normal_rows = inverse * scale;  // element (row r, column c) of the inverse transpose is inverse[r][c]
  for (int i = 0; i < 3; ++i) {
    record.local_to_world[i] = glm::vec4(rows[i]);
    record.normal_to_world[i] = glm::vec3(normal_rows[i]);
  }
}

}  // namespace

SceneTables::SceneTables(Memory memory) : memory_(std::move(memory)), textures_(memory_) {
  Block block;
  block.add(specular_albedo_table());
  specular_albedo_ = block.upload(memory_.device);
}

void SceneTables::update(const Scene& scene, const Band& band, uint32_t environment_count) {
  if (&scene != scene_) forget(scene);
  const Revisions& now = scene.revisions();
  const bool geometry_changed = now.instances != seen_.instances || now.meshes != seen_.meshes;
  const bool patterns_changed = now.textures != seen_.textures && textures_.update(scene);
  const bool lights_changed = now.lights != seen_.lights || patterns_changed || now.materials != seen_.materials ||
                              (geometry_changed && (light_features_ != 0 || emissive_[band.infrared ? 1 : 0])) || !(band == band_) ||
                              environment_count != environment_count_;
  band_ = band;
  if (now.meshes != seen_.meshes) move_vertices(scene);
  if (meshes_.size() < scene.meshes().size()) add_meshes(scene);
  if (now.materials != seen_.materials) write_materials(scene);
  if (now.instances != seen_.instances || now.meshes != seen_.meshes || now.materials != seen_.materials) write_instances(scene);
  if (lights_changed) write_lights(scene, environment_count);
  seen_ = now;
  environment_count_ = environment_count;
  tables_.resize(memory_, 1)[0] = {instances_.address(),
                                   instance_materials_.address(),
                                   materials_.address(),
                                   textures_.address(),
                                   lights_.address(),
                                   environments_.address(),
                                   memory_.address(*specular_albedo_),
                                   light_shapes_.address(),
                                   light_cumulative_.address(),
                                   light_triangles_.address()};
}

void SceneTables::forget(const Scene& scene) {
  scene_ = &scene;
  seen_ = {0, 0, 0, 0, 0};
  blocks_.clear();
  meshes_.clear();
  textures_.forget();
}

void SceneTables::add_meshes(const Scene& scene) {
  Block block;
  const size_t first = meshes_.size();
  for (size_t i = first; i < scene.meshes().size(); ++i) {
    const Mesh& m = scene.meshes()[i];
    MeshAddresses a{};
    a.positions = block.add(m.positions);
    a.normals = block.add(m.normals);
    a.uvs = block.add(m.uvs);
    a.indices = block.add(m.indices);
    a.slots = block.add(m.slots);
    a.flags = (m.normals.empty() ? 0 : instance_has_normals) | (m.uvs.empty() ? 0 : instance_has_uvs) |
              (m.slots.empty() ? 0 : instance_has_slots);
    a.deformation = m.deformation;
    meshes_.push_back(a);
  }
  const auto buffer = blocks_.emplace_back(block.upload(memory_.device));
  for (size_t i = first; i < meshes_.size(); ++i) {
    for (uint64_t* offset : {&meshes_[i].positions, &meshes_[i].normals, &meshes_[i].uvs, &meshes_[i].indices, &meshes_[i].slots})
      *offset += memory_.address(*buffer);
    meshes_[i].block = buffer;
  }
}

void SceneTables::move_vertices(const Scene& scene) {
  for (size_t i = 0; i < meshes_.size(); ++i) {
    const Mesh& m = scene.meshes()[i];
    MeshAddresses& a = meshes_[i];
    if (m.deformation == a.deformation) continue;
    const uint64_t base = memory_.address(*a.block);
    a.block->write(a.positions - base, m.positions.data(), m.positions.size() * sizeof(glm::vec3));
    if (!m.normals.empty()) a.block->write(a.normals - base, m.normals.data(), m.normals.size() * sizeof(glm::vec3));
    a.deformation = m.deformation;
  }
}

void SceneTables::write_materials(const Scene& scene) {
  const std::vector<Material>& materials = scene.materials();
  const auto records = materials_.resize(memory_, materials.size() + 1);
  for (uint32_t i = 0; i < materials.size(); ++i) records[i] = record_of(materials[i], i);
  records[materials.size()] = record_of(grey_default(), none);
  has_glass_ = std::ranges::any_of(materials, [](const Material& m) { return m.transmission > 0.0f && m.metallic < 1.0f; });
  const auto special = [](const Material& m) {
    return m.diffuse_roughness > 0.0f || (m.transmission > 0.0f && (m.transmission_roughness > 0.0f || m.attenuation_distance_m > 0.0f));
  };
  material_features_ = std::ranges::any_of(materials, special) ? feature_materials : 0;
  emissive_[0] = std::ranges::any_of(materials, [](const Material& m) { return m.emission != glm::vec3(0); });
  emission_group_ = 0;
  for (const Material& m : materials) emission_group_ = std::max(emission_group_, m.light_group);
  emissive_[1] = std::ranges::any_of(materials, [](const Material& m) { return m.ir_emission != 0.0f; });
}

void SceneTables::write_instances(const Scene& scene) {
  const auto default_material = uint32_t(scene.materials().size());
  std::vector<InstanceRecord> records;
  std::vector<uint32_t> materials;
  for (uint32_t id = 0; id < scene.instances().size(); ++id) {
    const auto& instance = scene.instances()[id];
    if (!instance) continue;
    const MeshAddresses& mesh = meshes_[instance->mesh];
    InstanceRecord r{};
    r.positions = mesh.positions;
    r.normals = mesh.normals;
    r.uvs = mesh.uvs;
    r.indices = mesh.indices;
    r.slots = mesh.slots;
    r.flags = mesh.flags;
    set_transform(r, instance->local_to_world);
    r.first_material = uint32_t(materials.size());
    r.material_count = uint32_t(instance->materials.size());
    r.id = id;
    for (const uint32_t m : instance->materials) materials.push_back(m == none ? default_material : m);
    materials.push_back(default_material);  // for slots beyond the instance's materials
    records.push_back(r);
  }
  std::ranges::copy(records, instances_.resize(memory_, records.size()).begin());
  std::ranges::copy(materials, instance_materials_.resize(memory_, materials.size()).begin());
}

void SceneTables::write_lights(const Scene& scene, uint32_t environment_count) {
  const LightTable table =
      make_light_table(scene, band_, environment_count, [&](const Light& light) { return textures_.pattern(scene, light); });
  textures_.drop_unused();
  std::ranges::copy(table.lights, lights_.resize(memory_, table.lights.size()).begin());
  std::ranges::copy(table.shapes, light_shapes_.resize(memory_, table.shapes.size()).begin());
  std::ranges::copy(table.cumulative, light_cumulative_.resize(memory_, table.cumulative.size()).begin());
  std::ranges::copy(table.triangles, light_triangles_.resize(memory_, table.triangles.size()).begin());
  light_features_ = table.has_shapes ? feature_lights : 0;
  std::ranges::copy(table.environments, environments_.resize(memory_, table.environments.size()).begin());
  shadow_rays_per_vertex_ = table.shadow_rays_per_vertex;
  select_lights_ = table.select_lights;
  light_group_ = scene.environment().light_group;
  for (const LightRecord& light : table.lights) light_group_ = std::max(light_group_, light.light_group);
  has_environment_light_ = std::ranges::any_of(table.environments, [](const auto& e) { return e.radiance != glm::vec3(0); });
}

}  // namespace kuafu
