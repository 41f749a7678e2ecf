// SPDX-License-Identifier: Apache-2.0
// Stage `splat table`: landed beams are brought to the buckets of their cells. Atomics only count; the order in a bucket is that of the beams.
#include "lib/splat_table.glsl"

const uint no_entries = 0xffffffffu;

/// Whether a section may reach a cell: no plane between them has the section's slopes.
bool reaches(IN(Beam) p, vec3 to_middle, float half_cell) {
  vec3 u = p.position_u, v = p.position_v, n = p.direction_u;
  float to_u = abs(dot(u, to_middle)) - half_cell * (abs(u.x) + abs(u.y) + abs(u.z)), to_v = abs(dot(v, to_middle)) - half_cell * (abs(v.x) + abs(v.y) + abs(v.z));
  return max(max(to_u, to_v), abs(dot(n, to_middle)) - half_cell * (abs(n.x) + abs(n.y) + abs(n.z))) < 1.0f;
}

void reach_cell(IN(SplatTable) table, uint beam, IN(Beam) p, ivec3 cell) {
  float cell_m = 1.0f / cells_per_metre(p.level);
  if (!reaches(p, (vec3(float(cell.x), float(cell.y), float(cell.z)) + 0.5f) * cell_m - p.position, 0.5f * cell_m)) return;
  uint word = head_word(bucket_of(table, cell, p.level, p.light, p.environment));
  if (push.step == splat_step_tally) {
    atomicAdd(table.words.at[word + 1u], 1u);
  } else if (table.words.at[word] != no_entries) {
    table.words.at[entry_word(table, table.words.at[word] + atomicAdd(table.words.at[word + 1u], 1u))] = beam;
  }
}

/// Counts a beam in the buckets of the cells that its section reaches, or enters it there.
void reach_cells(IN(SplatTable) table, uint beam) {
  IN(Beam) p = table.beams.at[beam];
  if ((p.state & beam_landed) == 0u) return;
  if (push.step == splat_step_tally) atomicOr(table.words.at[splat_levels], 1u << uint(p.level - splat_least_level));
  vec3 half_width = half_width_of(p);
  ivec3 first = cell_of(p.position - half_width, p.level), last = cell_of(p.position + half_width, p.level);
  last = min(last, first + int(splat_most_cells_along));
  // The axis that the surface faces has few cells at each place of the other two.
  vec3 facing = abs(p.direction_u);
  int up = facing.x > facing.y ? (facing.x > facing.z ? 0 : 2) : (facing.y > facing.z ? 1 : 2), i = (up + 1) % 3, j = (up + 2) % 3;
  float cell_m = 1.0f / cells_per_metre(p.level), slope_i = p.direction_u[i] / p.direction_u[up], slope_j = p.direction_u[j] / p.direction_u[up];
  float thick = 1.0f / facing[up] + 0.5f * cell_m * (abs(slope_i) + abs(slope_j));
  ivec3 cell;
  for (cell[i] = first[i]; cell[i] <= last[i]; ++cell[i])
    for (cell[j] = first[j]; cell[j] <= last[j]; ++cell[j]) {
      float across_i = (float(cell[i]) + 0.5f) * cell_m - p.position[i], across_j = (float(cell[j]) + 0.5f) * cell_m - p.position[j];
      float height = p.position[up] - slope_i * across_i - slope_j * across_j;
      int low = max(int(floor((height - thick) / cell_m)), first[up]), high = min(int(floor((height + thick) / cell_m)), last[up]);
      for (cell[up] = low; cell[up] <= high; ++cell[up]) reach_cell(table, beam, p, cell);
    }
}

void claim(IN(SplatTable) table, uint bucket) {
  uint word = head_word(bucket), count = table.words.at[word + 1u];
  if (count == 0u) return;
  uint first = atomicAdd(table.words.at[splat_used], count);
  table.words.at[word] = first + count <= table.entries ? first : no_entries;
  table.words.at[word + 1u] = 0u;
}

/// Sinks word `at` of a heap of `count` words.
void sink(UintArray words, uint first, uint at, uint count) {
  uint value = words.at[first + at];
  for (;;) {
    uint child = 2u * at + 1u;
    if (child >= count) break;
    if (child + 1u < count && words.at[first + child + 1u] > words.at[first + child]) ++child;
    if (words.at[first + child] <= value) break;
    words.at[first + at] = words.at[first + child];
    at = child;
  }
  words.at[first + at] = value;
}

/// Heap sort: where light is focused, a bucket may have thousands.
void order(IN(SplatTable) table, uint bucket) {
  uint word = head_word(bucket), count = table.words.at[word + 1u];
  if (count < 2u) return;
  UintArray words = table.words;
  uint first = entry_word(table, words.at[word]);
  for (uint at = count / 2u; at > 0u; --at) sink(words, first, at - 1u, count);
  for (uint end = count - 1u; end > 0u; --end) {
    uint greatest = words.at[first];
    words.at[first] = words.at[first + end];
    words.at[first + end] = greatest;
    sink(words, first, 0u, end);
  }
}

void table_step(uint i) {
  IN(SplatTable) table = push.table.at[0];
  bool of_buckets = push.step == splat_step_claim || push.step == splat_step_order;
  if (i >= (of_buckets ? table.buckets : table.beam_count)) return;
  if (push.step == splat_step_claim) claim(table, i);
  if (push.step == splat_step_order) order(table, i);
  if (!of_buckets) reach_cells(table, i);
}
