// SPDX-License-Identifier: Apache-2.0
#include "light/light_table.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/gtc/packing.hpp>
#include <numbers>

#include "material/texels.h"

namespace kuafu {
namespace {

double emission_of(const Material& m, const Band& band) { return brightness(band.color(m.emission, m.ir_emission)); }

/// The instance in slot `index` adds its shining triangles; their weights are emission times area.
void add_triangles(const Scene& scene, const Band& band, const Instance& instance, uint32_t index, std::vector<double>& weights,
                   std::vector<uint32_t>& triangles) {
  const Mesh& mesh = scene.meshes()[instance.mesh];
  for (uint32_t i = 0; i < mesh.indices.size(); ++i) {
    const uint32_t slot = mesh.slots.empty() ? 0 : mesh.slots[i];
    const uint32_t material = slot < instance.materials.size() ? instance.materials[slot] : none;
    const double emission = material == none ? 0 : emission_of(scene.materials()[material], band);
    if (emission == 0) continue;
    glm::dvec3 p[3];
    for (int k = 0; k < 3; ++k) p[k] = instance.local_to_world * glm::dvec4(mesh.positions[mesh.indices[i][k]], 1.0);
    weights.push_back(emission * 0.5 * glm::length(glm::cross(p[1] - p[0], p[2] - p[0])));
    triangles.insert(triangles.end(), {index, i});
  }
}

/// Running sums divided by their last; returns that.
double append_cumulative(std::vector<float>& to, const std::vector<double>& weights) {
  double sum = 0, running = 0;
  for (const double w : weights) sum += w;
  for (size_t i = 0; i < weights.size(); ++i) {
    running += weights[i];
    to.push_back(i + 1 == weights.size() ? 1.0f : float(sum > 0 ? running / sum : double(i + 1) / double(weights.size())));
  }
  return sum;
}

glm::vec3 texel_at(const Texels& texels, size_t i) {
  if (texels.format == texel_half4) return {glm::unpackHalf2x16(texels.words[2 * i]), glm::unpackHalf2x16(texels.words[2 * i + 1]).x};
  glm::vec3 value;
  std::memcpy(&value, &texels.words[4 * i], sizeof value);
  return value;
}

/// Mean brightness of each texel's cell. Texels are interpolated, so a cell has 1/8 of its neighbours' on both axes; columns go round, rows
/// end.
std::vector<float> cell_means(const Texture& texture, const Band& band) {
  const Texels texels = linear_texels(texture);
  const size_t width = texture.width, height = texture.height;
  std::vector<float> along_rows(width * height), means(width * height);
  const auto value = [&](size_t i) {
    const glm::vec3 texel = texel_at(texels, i);
    return std::max(0.0f, float(brightness(band.color(texel, texel.x))));
  };
  for (size_t row = 0; row < height * width; row += width)
    for (size_t x = 0; x < width; ++x)
      along_rows[row + x] = 0.75f * value(row + x) + 0.125f * (value(row + (x + width - 1) % width) + value(row + (x + 1) % width));
  for (size_t y = 0; y < height; ++y)
    for (size_t x = 0; x < width; ++x)
      means[y * width + x] = 0.75f * along_rows[y * width + x] +
                             0.125f * (along_rows[(y > 0 ? y - 1 : 0) * width + x] + along_rows[std::min(y + 1, height - 1) * width + x]);
  return means;
}

}  // namespace

bool shines(const Scene& scene, const Band& band, const Instance& instance) {
  for (const uint32_t m : instance.materials)
    if (m != none && emission_of(scene.materials()[m], band) > 0) return true;
  return false;
}

std::optional<LightEntry> mesh_light(const Scene& scene, const Band& band, uint32_t environment, LightTable& table) {
  std::vector<double> weights;
  std::vector<uint32_t> triangles;
  for (uint32_t slot = 0; slot < scene.instance_slots().size(); ++slot) {
    const uint32_t id = scene.instance_slots()[slot];
    if (id == none) continue;
    const Instance& instance = scene.instances()[id];
    if ((instance.environment == none || instance.environment == environment) && shines(scene, band, instance))
      add_triangles(scene, band, instance, slot, weights, triangles);
  }
  LightEntry e;
  e.record.kind = light_mesh;
  e.shape.texture = no_texture;
  e.shape.first = uint32_t(table.cumulative.size());
  e.shape.count = uint32_t(weights.size());
  e.shape.first_triangle = uint32_t(table.triangles.size() / 2);
  double total = 0;
  for (const double w : weights) total += w;
  if (!(total > 0)) return std::nullopt;
  append_cumulative(table.cumulative, weights);
  table.triangles.insert(table.triangles.end(), triangles.begin(), triangles.end());
  e.shape.total = float(total);
  e.record.intensity = glm::vec3(1.0f);
  e.power = 2 * std::numbers::pi * total;  // both sides shine
  e.shaped = true;
  return e;
}

std::optional<LightEntry> map_light(const Scene& scene, const Band& band, double world_radius_m, LightTable& table) {
  const Environment& environment = scene.environment();
  if (environment.texture == none) return std::nullopt;
  const Texture& texture = scene.textures()[environment.texture];
  const std::vector<float> means = cell_means(texture, band);
  std::vector<double> rows(texture.height);
  std::vector<float> cells;
  for (uint32_t y = 0; y < texture.height; ++y) {
    const double sine = std::sin(std::numbers::pi * (y + 0.5) / texture.height);
    std::vector<double> row(texture.width);
    for (uint32_t x = 0; x < texture.width; ++x) row[x] = double(means[size_t(y) * texture.width + x]) * sine;
    rows[y] = append_cumulative(cells, row);
  }
  LightEntry e;
  e.record.kind = light_map;
  e.record.intensity = band.environment(environment.radiance, environment.ir_radiance);
  e.record.light_group = environment.light_group;
  LightShape& s = e.shape;
  s.axis_x = glm::vec3(environment.map_to_world[0]);
  s.axis_y = glm::vec3(environment.map_to_world[1]);
  s.axis_z = glm::vec3(environment.map_to_world[2]);
  s.texture = scene.textures().slot(environment.texture);
  s.first = uint32_t(table.cumulative.size());
  s.count = texture.height;
  s.columns = texture.width;
  s.half_texel = 0.5f / float(texture.height);
  const double sum = append_cumulative(table.cumulative, rows);
  table.cumulative.insert(table.cumulative.end(), cells.begin(), cells.end());
  const double solid_angle = 2 * std::numbers::pi * std::numbers::pi / (double(texture.width) * texture.height);
  e.power = brightness(e.record.intensity) * sum * solid_angle * std::numbers::pi * world_radius_m * world_radius_m;
  e.shaped = e.met = true;
  if (!(e.power > 0)) return std::nullopt;
  return e;
}

}  // namespace kuafu
