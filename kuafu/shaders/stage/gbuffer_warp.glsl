// SPDX-License-Identifier: Apache-2.0
// Stage `gbuffer`, step `warp`: a view from beside the left camera, row by row. Where two pixels land on one, the nearer one holds: in the
// row's order it comes later (McMillan 1997, occlusion-compatible order).

// Neighbours whose depths differ by less than a surface would that is tilted so far (tangent) are one surface.
const float steepest = 8.0f;
const int most_stretched_px = 3;  // more is torn

struct WarpedRow {
  FloatArray near, out_inverse;  // 1/m; below 0: not seen
  UintArray source;
  uint first;      // of the row
  bool mirrored;   // the view stands to the left: all columns count from the right
  bool has_source;
  float px_m, shift_px;
};

uint warped_column(IN(WarpedRow) row, int j) { return row.mirrored ? push.record.at[0].width - 1u - uint(j) : uint(j); }
float warped_place(IN(WarpedRow) row, int j, float near) { return float(j) - row.px_m * near + row.shift_px; }

void put_warped(IN(WarpedRow) row, int place, float inverse, uint column) {
  uint at = row.first + warped_column(row, place);
  row.out_inverse.at[at] = inverse;
  if (row.has_source) row.source.at[at] = column;
}

/// What lies between two neighbours of one surface.
void warp_between(IN(WarpedRow) row, int width) {
  uint column = warped_column(row, 0);
  float a = row.near.at[row.first + column], left = warped_place(row, 0, a);
  for (int j = 1; j < width; ++j) {
    uint next = warped_column(row, j);
    float b = row.near.at[row.first + next], right = warped_place(row, j, b);
    bool one = (abs(a - b) * push.record.at[0].focal_px <= steepest * min(a, b) || (a == 0.0f && b == 0.0f)) && right > left;
    if (one) {
      int begin = int(ceil(left)), end = min(min(int(floor(right)), begin + most_stretched_px - 1), width - 1);
      for (int place = max(begin, 0); place <= end; ++place) {
        float share = (float(place) - left) / (right - left);
        put_warped(row, place, a + share * (b - a), share > 0.5f ? next : column);
      }
    }
    a = b;
    left = right;
    column = next;
  }
}

/// Each pixel reaches half a pixel to its sides: at edges over what lies farther, and over gaps.
void warp_middles(IN(WarpedRow) row, int width) {
  for (int j = 0; j < width; ++j) {
    uint column = warped_column(row, j);
    float own = row.near.at[row.first + column];
    int middle = int(floor(warped_place(row, j, own) + 0.5f));
    if (middle < 0 || middle >= width) continue;
    float there = row.out_inverse.at[row.first + warped_column(row, middle)];
    if (own > there * (1.0f + steepest / push.record.at[0].focal_px)) put_warped(row, middle, own, column);
  }
}

/// What is not seen continues the farther one of the two surfaces beside it.
void fill_unseen(IN(WarpedRow) row, int width) {
  int before = -1;
  for (int place = 0; place <= width; ++place) {
    bool seen = place == width || row.out_inverse.at[row.first + warped_column(row, place)] >= 0.0f;
    if (!seen) continue;
    if (place > before + 1 && !(place == width && before < 0)) {
      int from = before < 0 ? place : before;
      if (before >= 0 && place < width && row.out_inverse.at[row.first + warped_column(row, place)] < row.out_inverse.at[row.first + warped_column(row, before)]) from = place;
      uint at = row.first + warped_column(row, from);
      for (int gap = before + 1; gap < place; ++gap) put_warped(row, gap, row.out_inverse.at[at], row.source.at[at]);
    }
    before = place;
  }
}

/// Row i of all: the right camera's, then the projector's.
void warp_row(uint i) {
  uint rows = push.record.at[0].environments * push.record.at[0].height;
  bool to_projector = i >= rows;
  IN(GbufferCamera) left = push.record.at[0].cameras[0];
  IN(GbufferCamera) right = push.record.at[0].cameras[1];
  if (to_projector ? push.record.at[0].projector_depth_given != 0u : (right.given & gbuffer_has_depth) != 0u) return;
  float px_m = to_projector ? left.projector_px_m : push.record.at[0].baseline_px_m, shift_px = to_projector ? 0.0f : right.shift_px;
  WarpedRow row;
  row.near = left.inverse_depth;
  row.has_source = !to_projector;
  if (to_projector) row.out_inverse = push.record.at[0].projector_inverse;
  else row.out_inverse = right.inverse_depth;
  row.source = right.source;
  row.first = (to_projector ? i - rows : i) * push.record.at[0].width;
  row.mirrored = px_m < 0.0f;
  row.px_m = abs(px_m);
  row.shift_px = row.mirrored ? -shift_px : shift_px;
  int width = int(push.record.at[0].width);
  for (int j = 0; j < width; ++j) put_warped(row, j, -1.0f, uint(j));
  warp_between(row, width);
  warp_middles(row, width);
  if (!to_projector) fill_unseen(row, width);
}
