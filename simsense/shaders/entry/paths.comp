// SPDX-License-Identifier: Apache-2.0
// Rows and columns, in one dispatch with the rows first because they are the longest or in one each, or both kinds of diagonals: a path runs in a cluster of lanes
// without barriers, a workgroup holds both paths of its lines, which wait for each other where they meet, once.
// Compiled twice: with HALF_MIN minima are packed half floats, where the device has them and the costs' range fits; else integers.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/walk_lines.glsl"
#include "lib/walk_rows.glsl"

/// Columns of one workgroup lie side by side or, where costs come from census words, four apart: they read the same shifted copy of the words.
uint line_of(bool horizontal, uint group, uint lines) {
  uint local_line = cluster() % lines;
  return horizontal || (stored_costs && !diagonal) ? group * lines + local_line : (group / 4u * lines + local_line) * 4u + group % 4u;
}

Path make_path(bool horizontal, bool leftward, uint group) {
  uint lines = cluster_count() / 2u, count = horizontal ? push.height : push.width, line = line_of(horizontal, group, lines);
  Path p;
  p.pixels = horizontal ? push.width : push.height;
  p.kept = line < count ? p.pixels : 0u;
  p.line = min(line, count - 1u);
  p.backward = cluster() >= lines;
  p.drift = leftward != p.backward ? -1 : 1;
  p.mirrored = horizontal && p.backward;
  set_times(p, horizontal);
  return p;
}

/// One level of functions, each called from one place: what NVIDIA's compiler does not inline keeps its arrays in memory.
void main() {
  uint lines = cluster_count() / 2u, row_groups = part == PATHS_ROWS_AND_COLUMNS ? (push.height + lines - 1u) / lines : 0u;
  bool horizontal = part == PATHS_ROWS || gl_WorkGroupID.x < row_groups;
  bool leftward = diagonal && gl_WorkGroupID.x % 2u != 0u;  // one of a pair of groups goes down to the right, the other down to the left
  Path p = make_path(horizontal, leftward, diagonal ? gl_WorkGroupID.x / 2u : horizontal ? gl_WorkGroupID.x : gl_WorkGroupID.x - row_groups);
  begin_path(p.mirrored);
  gray_before = 0u;
  if (horizontal && !stored_costs) {
    walk_rows(push.first_sums, p);
  } else {
    walk_lines(horizontal || leftward ? push.first_sums : push.second_sums, p);
  }
}
