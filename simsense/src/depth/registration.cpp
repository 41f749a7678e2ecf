#include "depth/registration.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

#include "device/thread_pool.h"

namespace simsense {
namespace {
constexpr int32_t nothing = 0x7f800000;  // bits of +infinity

/// target = the least of `count` neighbours from each element on.
void least_across(const int32_t* __restrict from, size_t count, size_t size, int32_t* __restrict target) {
  std::copy_n(from, size, target);
  for (size_t k = 1; k < count; ++k)
    for (size_t x = 0; x < size; ++x) target[x] = std::min(target[x], from[x + k]);
}

void take_less(const int32_t* __restrict from, size_t size, int32_t* __restrict target) {
  for (size_t x = 0; x < size; ++x) target[x] = std::min(target[x], from[x]);
}

}  // namespace

Registration::Registration(const StereoGeometry& left, uint32_t width, uint32_t height, const simsense_camera& rgb,
                           const Rigid& left_to_rgb)
    : width_(width),
      height_(height),
      rgb_width_(rgb.width),
      rgb_height_(rgb.height),
      fx_(static_cast<float>(rgb.k[0])),
      fy_(static_cast<float>(rgb.k[4])),
      cx_(static_cast<float>(rgb.k[2])),
      cy_(static_cast<float>(rgb.k[5])),
      distorted_(is_distorted(rgb)),
      distortion_(simsense::distortion(rgb)),
      nearest_(size_t{rgb.width + 2 * SPLAT_MARGIN} * (rgb.height + 2 * SPLAT_MARGIN)) {
  const Rigid rectified_to_rgb = compose(left_to_rgb, {transposed(left.left_to_rectified), {}});
  const Pinhole& k = left.camera;
  for (size_t i = 0; i < 3; ++i) {
    const double* r = rectified_to_rgb.rotation.data() + 3 * i;
    pixel_to_rgb_[3 * i] = r[0] / k.fx;
    pixel_to_rgb_[3 * i + 1] = r[1] / k.fy;
    pixel_to_rgb_[3 * i + 2] = r[2] - r[0] * k.cx / k.fx - r[1] * k.cy / k.fy;
    translation_[i] = static_cast<float>(rectified_to_rgb.translation[i]);
  }
}

Registration::Registration(const simsense_rig_desc& rig, const StereoGeometry& left)
    : Registration(left, rig.left.width, rig.left.height, rig.rgb, rigid(rig.left_to_rgb)) {
  unrectified_ = (rig.faults & SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED) != 0;
  splat_invalid_ = (rig.faults & SIMSENSE_FAULT_SPLAT_INVALID) != 0;
  if (rig.faults & SIMSENSE_FAULT_SPLAT_CLIPPED) landing_margin_ = 0;
  if (!unrectified_) return;
  // K_rgb * rotation * K_left^-1 and K_rgb * translation: image coordinates times z
  const Pinhole l = pinhole(rig.left), c = pinhole(rig.rgb);
  const Rigid to_rgb = rigid(rig.left_to_rgb);
  const std::array<double, 6> k{c.fx, c.cx, c.fy, c.cy, 0, 1};  // per row: factors of that row and of the last one
  for (size_t i = 0; i < 3; ++i) {
    const auto image = [&](double own, double last) { return k[2 * i] * own + k[2 * i + 1] * last; };
    const double* own = to_rgb.rotation.data() + 3 * i;
    const double* last = to_rgb.rotation.data() + 6;
    const double x = image(own[0], last[0]) / l.fx, y = image(own[1], last[1]) / l.fy;
    pixel_to_rgb_[3 * i] = x;
    pixel_to_rgb_[3 * i + 1] = y;
    pixel_to_rgb_[3 * i + 2] = image(own[2], last[2]) - x * l.cx - y * l.cy;
    translation_[i] = static_cast<float>(image(to_rgb.translation[i], to_rgb.translation[2]));
  }
}

std::array<float, 3> Registration::ray_step() const {
  return {static_cast<float>(pixel_to_rgb_[0]), static_cast<float>(pixel_to_rgb_[3]), static_cast<float>(pixel_to_rgb_[6])};
}

std::array<float, 3> Registration::ray_start(uint32_t y) const {
  std::array<float, 3> start;
  for (size_t i = 0; i < 3; ++i) start[i] = static_cast<float>(pixel_to_rgb_[3 * i + 1] * y + pixel_to_rgb_[3 * i + 2]);
  return start;
}

/// Branchless, so that the compiler makes vectors of the loops around it. column, row: to be rounded down.
int32_t Registration::cell_at(float column, float row, bool seen) const {
  const auto m = static_cast<float>(landing_margin_);
  seen = seen & (column >= -m) & (row >= -m) & (column < static_cast<float>(rgb_width_) + m) & (row < static_cast<float>(rgb_height_) + m);
  const float c = seen ? column : 0, r = seen ? row : 0;
  const auto whole = [](float v) { return static_cast<int32_t>(v) - (static_cast<float>(static_cast<int32_t>(v)) > v); };
  const int32_t cell = (whole(r) + SPLAT_MARGIN) * static_cast<int32_t>(pitch()) + whole(c) + SPLAT_MARGIN;
  return seen ? cell : -1;
}

void Registration::project(const float* depth, size_t first, size_t count, uint32_t y, Landings& out) const {
  const std::array<float, 3> step = ray_step(), start = ray_start(y), t = translation_;
  std::array<float, chunk> nx, ny;
  for (size_t i = 0; i < count; ++i) {
    const float z = depth[first + i], u = static_cast<float>(first + i);
    out.z[i] = z * (step[2] * u + start[2]) + t[2];
    nx[i] = (z * (step[0] * u + start[0]) + t[0]) / out.z[i];
    ny[i] = (z * (step[1] * u + start[1]) + t[1]) / out.z[i];
  }
  if (distorted_) {
    for (size_t i = 0; i < count; ++i)
      if (!distortion_.apply(nx[i], ny[i])) out.z[i] = -1;
  }
  for (size_t i = 0; i < count; ++i) {
    const bool seen = ((depth[first + i] > 0) | splat_invalid_) & (out.z[i] > 0);
    out.cell[i] = cell_at(fx_ * nx[i] + cx_ + 0.5f, fy_ * ny[i] + cy_ + 0.5f, seen);
  }
}

/// The published arithmetic: one multiply-add per coordinate, halves away from zero.
void Registration::project_unrectified(const float* depth, size_t first, size_t count, uint32_t y, Landings& out) const {
  for (size_t i = 0; i < count; ++i) {
    const float z = depth[first + i];
    float seen[3];
    for (size_t k = 0; k < 3; ++k) {
      const double* m = pixel_to_rgb_.data() + 3 * k;
      seen[k] = std::fma(static_cast<float>(m[0] * static_cast<double>(first + i) + m[1] * y + m[2]), z, translation_[k]);
    }
    out.z[i] = seen[2];
    out.cell[i] = cell_at(std::round(seen[0] / seen[2]), std::round(seen[1] / seen[2]), (z > 0 || splat_invalid_) && seen[2] > 0);
  }
}

void Registration::keep_nearest(const Landings& landings, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    if (landings.cell[i] < 0) continue;
    std::atomic_ref<int32_t> cell(nearest_[static_cast<size_t>(landings.cell[i])]);
    const auto bits = std::bit_cast<int32_t>(landings.z[i]);
    int32_t seen = cell.load(std::memory_order_relaxed);
    while (bits < seen && !cell.compare_exchange_weak(seen, bits, std::memory_order_relaxed)) {
    }
  }
}

void Registration::splat_row(const float* depth, uint32_t y) {
  Landings landings;
  for (size_t first = 0; first < width_; first += chunk) {
    const size_t count = std::min(chunk, width_ - first);
    if (unrectified_) {
      project_unrectified(depth, first, count, y, landings);
    } else {
      project(depth, first, count, y, landings);
    }
    keep_nearest(landings, count);
  }
}

/// scratch: two rows of the z-buffer.
void Registration::resolve_row(const DepthRange& range, uint32_t splat_size, uint32_t y, int32_t* scratch, float* out) const {
  const size_t first = SPLAT_MARGIN - (splat_size - 1) / 2;  // where n is even, points to the right and below reach one farther
  const int32_t* rows = nearest_.data() + (y + first) * pitch() + first;
  int32_t *below = scratch, *least = scratch + pitch();
  const size_t columns = rgb_width_ + splat_size - 1;
  std::copy_n(rows, columns, below);
  for (size_t k = 1; k < splat_size; ++k) take_less(rows + k * pitch(), columns, below);
  least_across(below, splat_size, rgb_width_, least);
  for (size_t x = 0; x < rgb_width_; ++x) out[x] = range.keep(std::bit_cast<float>(least[x]));  // which infinity is not within
}

void Registration::apply(const float* depth, const DepthRange& range, uint32_t splat_size, float* out, ks::ThreadPool& workers) {
  std::fill(nearest_.begin(), nearest_.end(), nothing);
  workers.parallel_for(height_, [&](size_t y) { splat_row(depth + y * width_, static_cast<uint32_t>(y)); });
  constexpr size_t rows = 16;
  workers.parallel_for((rgb_height_ + rows - 1) / rows, [&](size_t block) {
    std::vector<int32_t> scratch(2 * pitch());
    for (size_t y = block * rows; y < std::min<size_t>((block + 1) * rows, rgb_height_); ++y)
      resolve_row(range, splat_size, static_cast<uint32_t>(y), scratch.data(), out + y * rgb_width_);
  });
}

}  // namespace simsense
