// All four paths in one dispatch, rows first because they are the longest: a path runs in a cluster of lanes without barriers. A workgroup
// holds both paths of its lines, which wait for each other where they meet.
#include "lib/walk_lines.glsl"
#include "lib/walk_rows.glsl"

Path make_path(bool horizontal, uint group) {
  uint lines = cluster_count() / 2u, local_line = cluster() % lines;
  uint count = horizontal ? push.height : push.width, line = group * lines + local_line;
  Path p;
  p.pixels = horizontal ? push.width : push.height;
  p.valid = line < count;
  p.line = min(line, count - 1u);
  p.backward = cluster() >= lines;
  p.mirrored = horizontal && p.backward;
  p.stride = (horizontal ? 1 : int(push.width)) * (p.backward ? -1 : 1);
  p.first = gl_WorkGroupID.z * push.width * push.height + p.line * (horizontal ? push.width : 1u);
  if (p.backward) p.first += (p.pixels - 1u) * (horizontal ? 1u : push.width);
  uint back_blocks = p.pixels / (2u * steps);
  p.add_from = p.backward ? back_blocks * steps : p.pixels - back_blocks * steps;
  return p;
}

/// Blocks of `steps` pixels that the path visits in a phase. 0: forward and backward paths up to where they meet. 1: the forward path
/// closes the gap of less than a block that may be left. 2: both go on over what the other has left.
uvec2 phase_blocks(Path p, uint phase) {
  uint back_blocks = p.pixels / (2u * steps), all = (p.pixels + steps - 1u) / steps;
  if (p.backward) return phase == 0u ? uvec2(0u, back_blocks) : phase == 1u ? uvec2(back_blocks) : uvec2(back_blocks, all);
  uint rest = p.pixels - back_blocks * steps, met_at = rest / steps, gap = rest % steps != 0u ? 1u : 0u;
  return phase == 0u ? uvec2(0u, met_at) : phase == 1u ? uvec2(met_at, met_at + gap) : uvec2(met_at + gap, all);
}

void main() {
  uint row_groups = (push.height + cluster_count() / 2u - 1u) / (cluster_count() / 2u);
  bool horizontal = gl_WorkGroupID.x < row_groups;
  Path p = make_path(horizontal, horizontal ? gl_WorkGroupID.x : gl_WorkGroupID.x - row_groups);
  begin_path(p.mirrored);
  [[dont_unroll]] for (uint phase = 0u; phase < 3u; ++phase) {
    uvec2 blocks = phase_blocks(p, phase);
    if (horizontal && !stored_costs) {
      walk_rows(push.horizontal, p, blocks.x, blocks.y);
    } else {
      walk_lines(horizontal ? push.horizontal : push.vertical, p, blocks.x, blocks.y);
    }
    memoryBarrierBuffer();
    barrier();
  }
}
