// SPDX-License-Identifier: Apache-2.0
// What landed about a point, out of the table (lib/splat_table.glsl): of all beams that cover it one is taken, with a chance by what it brings.
const uint no_beam = 0xffffffffu;

struct Gathered {
  float total;  // of all beams' gains
  vec3 direction, lit;
  Spectrum gain;  // of the one, its largest channel 1
};

/// Where a point lies in a beam's section, in nodes of its grid from the middle; false: outside.
bool find_in_section(IN(Beam) p, vec3 point, OUT(vec2) place) {
  vec3 offset = point - p.position;
  place = vec2(dot(offset, p.position_u), dot(offset, p.position_v));
  if (max(abs(place.x), abs(place.y)) >= 1.0f) return false;
  return abs(dot(offset, p.direction_u)) <= 1.0f;
}

void weigh_beam(IN(Beam) p, vec2 place, INOUT(Gathered) g, INOUT(float) random) {
  float largest = max(p.gain.x, max(p.gain.y, p.gain.z)), brings = (1.0f - abs(place.x)) * (1.0f - abs(place.y)) * largest;
  g.total += brings;
  float chance = brings / g.total;
  bool taken = random < chance;
  random = taken ? random / chance : (random - chance) / max(1.0f - chance, 1e-6f);
  if (!taken) return;
  g.direction = -p.direction;
  g.lit = p.lit + p.lit_u * place.x + p.lit_v * place.y;
  g.gain = band_of(p.gain) / largest;
}

Gathered gather_about(vec3 point, uint light, uint environment, float random) {
  IN(SplatTable) table = push.splats.at[0];
  Gathered g = Gathered(0.0f, vec3(0.0f), vec3(0.0f), Spectrum(0.0f));
  for (uint levels = table.words.at[splat_levels]; levels != 0u; levels &= levels - 1u) {
    int level = findLSB(levels) + splat_least_level;
    uint bucket = bucket_of(table, cell_of(point, level), level, light, environment), head = head_word(bucket);
    uint entry = entry_word(table, table.words.at[head]), end = entry + table.words.at[head + 1u];
    uint last = no_beam;
    for (; entry < end; ++entry) {
      uint beam = table.words.at[entry];
      if (beam == last) continue;
      last = beam;
      IN(Beam) p = table.beams.at[beam];
      vec2 place;
      if (!find_in_section(p, point, place)) continue;
      if (p.level == level && p.light == light && p.environment == environment) weigh_beam(p, place, g, random);  // else another cell's, of the same bucket
    }
  }
  return g;
}
