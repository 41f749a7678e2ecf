// SPDX-License-Identifier: Apache-2.0
// Directional albedos of GGX lobes and of rough glass, read from their tables (material/albedo_tables.h, material/albedo_tables.h).
#ifndef KUAFU_ALBEDO_TABLE_GLSL
#define KUAFU_ALBEDO_TABLE_GLSL
#include "lib/language.glsl"
#include "shared/scene_records.h"

const int lobe_size = int(specular_albedo_size), layer_size = int(layer_albedo_size);

/// The table's cell that x is in, of `size` entries; NaN is in one too.
int table_cell(float x, int size) { return clamp(int(x), 0, size - 2); }

// Split-sum terms of a metal's directional albedo: E = f0 x + f90 y.
vec2 lobe_albedo(Vec2Array table, float cosine, float roughness) {
  float x = clamp(cosine, 0.0f, 1.0f) * float(lobe_size - 1), y = clamp(roughness, 0.0f, 1.0f) * float(lobe_size - 1);
  int column = table_cell(x, lobe_size), line = table_cell(y, lobe_size), row = line * lobe_size + column, next = row + lobe_size;
  float f = x - float(column);
  return mix(mix(table.at[row], table.at[row + 1], f), mix(table.at[next], table.at[next + 1], f), y - float(line));
}

/// Mean over the hemisphere, weighted by the cosine, of the albedo of a lobe without loss at the facets.
float lobe_mean(Vec2Array table, float roughness) {
  float p = clamp(roughness, 0.0f, 1.0f) * float(lobe_size - 1);
  int i = table_cell(p, lobe_size), first = lobe_size * lobe_size;
  return mix(table.at[first + i].x, table.at[first + i + 1].x, p - float(i));
}

/// Rows of an index and a roughness.
struct AlbedoRows {
  int first, next;  // entries of the first row, and of that of the next index
  float roughness_part, index_part;  // of the way to the next ones
};

/// Of a table with `indices` at equal steps of index_place, which is in 0..1, and `roughnesses`.
AlbedoRows find_rows(float index_place, int indices, float roughness, int roughnesses, int table_first, int row_size) {
  float i = min(index_place, 1.0f) * float(indices - 1), r = clamp(roughness, 0.0f, 1.0f) * float(roughnesses - 1);
  int index = table_cell(i, indices), row = table_cell(r, roughnesses);
  AlbedoRows rows;
  rows.first = table_first + (index * roughnesses + row) * row_size;
  rows.next = rows.first + roughnesses * row_size;
  rows.roughness_part = r - float(row);
  rows.index_part = i - float(index);
  return rows;
}

/// Entry c of the rows.
vec2 rows_entry(IN(AlbedoRows) rows, Vec2Array table, int c, int row_size) {
  int row = rows.first + c, next = rows.next + c;
  vec2 e = mix(table.at[row], table.at[row + row_size], rows.roughness_part);
  if (rows.index_part == 0.0f) return e;
  return mix(e, mix(table.at[next], table.at[next + row_size], rows.roughness_part), rows.index_part);
}

/// Rows of a dielectric layer.
AlbedoRows find_layer_rows(float ior, float roughness) {
  return find_rows((ior - 1.0f) / (ior + 1.0f), layer_size, roughness, layer_size, int(layer_albedo_first), lobe_size);
}

/// Share of light that such a layer reflects, one facet and several.
float albedo_of_layer(IN(AlbedoRows) rows, Vec2Array table, float cosine) {
  float p = clamp(cosine, 0.0f, 1.0f) * float(lobe_size - 1);
  int c = table_cell(p, lobe_size);
  vec2 e = rows_entry(rows, table, c, lobe_size);
  return mix(e.x, e.y, p - float(c));
}

/// Its mean over the hemisphere.
float mean_of_layer(IN(AlbedoRows) rows, Vec2Array table) { return rows_entry(rows, table, lobe_size - 1, lobe_size).x; }
#endif
