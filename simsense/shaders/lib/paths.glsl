// Rows and columns in one dispatch, rows first because they are the longest: a path runs in a cluster of lanes without barriers, a workgroup
// holds both paths of its lines, which wait for each other where they meet, once.
#include "lib/walk_lines.glsl"
#include "lib/walk_rows.glsl"

/// Columns of one workgroup are four apart, so that they read the same shifted copy of the census words.
uint line_of(bool horizontal, uint group, uint lines) {
  uint local_line = cluster() % lines;
  return horizontal ? group * lines + local_line : (group / 4u * lines + local_line) * 4u + group % 4u;
}

Path make_path(bool horizontal, uint group) {
  uint lines = cluster_count() / 2u, count = horizontal ? push.height : push.width, line = line_of(horizontal, group, lines);
  Path p;
  p.pixels = horizontal ? push.width : push.height;
  p.kept = line < count ? p.pixels : 0u;
  p.line = min(line, count - 1u);
  p.backward = cluster() >= lines;
  p.mirrored = horizontal && p.backward;
  p.leftward = false;
  set_times(p, horizontal);
  return p;
}

/// Wrapped lines in both directions: one of a pair of groups goes down to the right, the other down to the left.
Path make_diagonal(uint group) {
  Path p = make_path(false, group / 2u);
  p.leftward = group % 2u != 0u;
  return p;
}

void main() {
  uint lines = cluster_count() / 2u, row_groups = diagonal ? 0u : (push.height + lines - 1u) / lines;
  bool horizontal = gl_WorkGroupID.x < row_groups;
  Path p = diagonal ? make_diagonal(gl_WorkGroupID.x) : make_path(horizontal, horizontal ? gl_WorkGroupID.x : gl_WorkGroupID.x - row_groups);
  begin_path(p.mirrored);
  gray_before = 0u;
  if (horizontal && !stored_costs) {
    walk_rows(push.horizontal, p);
  } else {
    walk_lines(horizontal || p.leftward ? push.horizontal : push.vertical, p);
  }
}
