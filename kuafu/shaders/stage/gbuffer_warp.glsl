// SPDX-License-Identifier: Apache-2.0
// Stage `gbuffer`, steps `between`, `middles` and `warp`: views from beside the left camera, which shift pixels along rows. Where two land on
// one, the one later in the row's order holds: it is nearer (McMillan 1997, occlusion-compatible order).

// Neighbours whose depths differ by less than a surface would that is tilted so far (tangent) are one surface.
const float steepest = 8.0f;
const int most_stretched_px = 3;  // more is torn

/// A row of the right camera's view, or of the projector's.
struct WarpedRow {
  uint first, order;  // its first pixel: in images of one camera, in `between` and `middles`
  bool to_projector;
  bool mirrored;  // the view stands to the left: all columns count from the right
  float px_m, shift_px;
};

uint warped_column(IN(WarpedRow) row, int j) { return row.mirrored ? push.record.at[0].width - 1u - uint(j) : uint(j); }
float left_inverse(IN(WarpedRow) row, int j) { return push.record.at[0].cameras[0].inverse_depth.at[row.first + warped_column(row, j)]; }
float warped_place(IN(WarpedRow) row, int j, float near) { return float(j) - row.px_m * near + row.shift_px; }

/// Pixel i of all: the right camera's, then the projector's. false: that view was given.
bool find_row(uint i, OUT(WarpedRow) row, OUT(int) j) {
  uint line = i / push.record.at[0].width, lines = push.record.at[0].environments * push.record.at[0].height;
  row.to_projector = line >= lines;
  row.order = line * push.record.at[0].width;
  row.first = row.to_projector ? row.order - pixels_per_camera() : row.order;
  float px_m = row.to_projector ? push.record.at[0].cameras[0].projector_px_m : push.record.at[0].baseline_px_m;
  float shift_px = row.to_projector ? 0.0f : push.record.at[0].cameras[1].shift_px;
  row.mirrored = px_m < 0.0f;
  row.px_m = abs(px_m);
  row.shift_px = row.mirrored ? -shift_px : shift_px;
  j = int(i - row.order);
  return row.to_projector ? push.record.at[0].projector_depth_given == 0u : (push.record.at[0].cameras[1].given & gbuffer_has_depth) == 0u;
}

/// The surface between a pixel and the one before it in its row.
struct WarpedPart {
  float first, last;  // 1/m
  float left, right;  // their places
};

WarpedPart part_before(IN(WarpedRow) row, int j) {
  WarpedPart part;
  part.first = left_inverse(row, j - 1);
  part.last = left_inverse(row, j);
  part.left = warped_place(row, j - 1, part.first);
  part.right = warped_place(row, j, part.last);
  return part;
}

void mark_between(uint i) {
  WarpedRow row;
  int j;
  if (!find_row(i, row, j) || j == 0) return;
  WarpedPart part = part_before(row, j);
  float step_px_m = abs(part.first - part.last) * push.record.at[0].focal_px, nearest = min(part.first, part.last);
  bool one = step_px_m <= steepest * nearest || (part.first == 0.0f && part.last == 0.0f);
  if (!one || part.right <= part.left) return;
  int begin = int(ceil(part.left)), end = min(min(int(floor(part.right)), begin + most_stretched_px - 1), int(push.record.at[0].width) - 1);
  for (int place = max(begin, 0); place <= end; ++place) atomicMax(push.record.at[0].between.at[row.order + uint(place)], uint(j));
}

/// What one place shows: 1/m, below 0 if the left camera does not see it; the left camera's column.
struct WarpedPixel {
  float inverse;
  uint column;
};

WarpedPixel between_at(IN(WarpedRow) row, int place) {
  int j = int(push.record.at[0].between.at[row.order + uint(place)]);
  if (j == 0) return WarpedPixel(-1.0f, uint(place));
  WarpedPart part = part_before(row, j);
  float share = (float(place) - part.left) / (part.right - part.left);
  return WarpedPixel(part.first + share * (part.last - part.first), warped_column(row, share > 0.5f ? j : j - 1));
}

/// Each pixel reaches half a pixel to its sides: at edges over what lies farther, and over gaps.
void mark_middle(uint i) {
  WarpedRow row;
  int j;
  if (!find_row(i, row, j)) return;
  float own = left_inverse(row, j);
  int middle = int(floor(warped_place(row, j, own) + 0.5f));
  if (middle < 0 || middle >= int(push.record.at[0].width)) return;
  if (own > between_at(row, middle).inverse * (1.0f + steepest / push.record.at[0].focal_px))
    atomicMax(push.record.at[0].middles.at[row.order + uint(middle)], uint(j) + 1u);
}

WarpedPixel warped_at(IN(WarpedRow) row, int place) {
  int after = int(push.record.at[0].middles.at[row.order + uint(place)]);
  return after > 0 ? WarpedPixel(left_inverse(row, after - 1), warped_column(row, after - 1)) : between_at(row, place);
}

/// The farther one of the two surfaces beside what is not seen goes on there.
WarpedPixel continued_at(IN(WarpedRow) row, int place) {
  WarpedPixel before = WarpedPixel(-1.0f, uint(place)), after = before;
  for (int p = place - 1; p >= 0 && before.inverse < 0.0f; --p) before = warped_at(row, p);
  for (int p = place + 1; p < int(push.record.at[0].width) && after.inverse < 0.0f; ++p) after = warped_at(row, p);
  return before.inverse < 0.0f || (after.inverse >= 0.0f && after.inverse < before.inverse) ? after : before;
}

void warp_pixel(uint i) {
  WarpedRow row;
  int place;
  if (!find_row(i, row, place)) return;
  WarpedPixel seen = warped_at(row, place);
  uint at = row.first + warped_column(row, place);
  if (row.to_projector) {
    push.record.at[0].projector_inverse.at[at] = seen.inverse;
    return;
  }
  if (seen.inverse < 0.0f) seen = continued_at(row, place);
  push.record.at[0].cameras[1].inverse_depth.at[at] = seen.inverse;
  push.record.at[0].cameras[1].source.at[at] = seen.column;
}
