#include "depth/registration.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

#include "device/thread_pool.h"

namespace simsense {
namespace {
constexpr uint32_t nothing = 0x7f800000;  // bits of +infinity
}

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
      nearest_(size_t{rgb.width} * rgb.height) {
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

void Registration::splat(float x, float y, float z) {
  if (!(z > 0)) return;
  float nx = x / z, ny = y / z;
  if (distorted_ && !distortion_.apply(nx, ny)) return;
  keep_nearest(std::floor(fx_ * nx + cx_ + 0.5f), std::floor(fy_ * ny + cy_ + 0.5f), z);
}

void Registration::keep_nearest(float column, float row, float z) {
  if (!(column >= 0 && row >= 0 && column < static_cast<float>(rgb_width_) && row < static_cast<float>(rgb_height_))) return;
  std::atomic_ref<uint32_t> cell(nearest_[static_cast<size_t>(row) * rgb_width_ + static_cast<size_t>(column)]);
  const uint32_t bits = std::bit_cast<uint32_t>(z);
  uint32_t seen = cell.load(std::memory_order_relaxed);
  while (bits < seen && !cell.compare_exchange_weak(seen, bits, std::memory_order_relaxed)) {
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

void Registration::splat_row(const float* depth, uint32_t y) {
  const std::array<float, 3> step = ray_step(), start = ray_start(y);
  for (uint32_t x = 0; x < width_; ++x) {
    const float z = depth[x];
    if (!(z > 0) && !splat_invalid_) continue;
    const float u = static_cast<float>(x);
    splat(z * (step[0] * u + start[0]) + translation_[0], z * (step[1] * u + start[1]) + translation_[1],
          z * (step[2] * u + start[2]) + translation_[2]);
  }
}

/// The published arithmetic: one multiply-add per coordinate, halves away from zero.
void Registration::splat_row_unrectified(const float* depth, uint32_t y) {
  for (uint32_t x = 0; x < width_; ++x) {
    const float z = depth[x];
    if (!(z > 0) && !splat_invalid_) continue;
    float seen[3];
    for (size_t i = 0; i < 3; ++i) {
      const double* m = pixel_to_rgb_.data() + 3 * i;
      seen[i] = std::fma(static_cast<float>(m[0] * x + m[1] * y + m[2]), z, translation_[i]);
    }
    if (seen[2] > 0) keep_nearest(std::round(seen[0] / seen[2]), std::round(seen[1] / seen[2]), seen[2]);
  }
}

void Registration::resolve_row(const DepthRange& range, uint32_t splat_size, uint32_t y, float* out) const {
  const uint32_t before = (splat_size - 1) / 2,
                 after = splat_size / 2;  // which points reach a pixel from the left and above, from the right and below
  const uint32_t first_row = y - std::min(y, before), end_row = std::min(rgb_height_, y + after + 1);
  for (uint32_t x = 0; x < rgb_width_; ++x) {
    const uint32_t first = x - std::min(x, before), end = std::min(rgb_width_, x + after + 1);
    uint32_t bits = nothing;
    for (uint32_t v = first_row; v < end_row; ++v) {
      const uint32_t* row = nearest_.data() + size_t{v} * rgb_width_;
      for (uint32_t u = first; u < end; ++u) bits = std::min(bits, row[u]);
    }
    out[x] = bits == nothing ? 0 : range.keep(std::bit_cast<float>(bits));
  }
}

void Registration::apply(const float* depth, const DepthRange& range, uint32_t splat_size, float* out, ks::ThreadPool& workers) {
  std::fill(nearest_.begin(), nearest_.end(), nothing);
  workers.parallel_for(height_, [&](size_t y) {
    if (unrectified_) {
      splat_row_unrectified(depth + y * width_, static_cast<uint32_t>(y));
    } else {
      splat_row(depth + y * width_, static_cast<uint32_t>(y));
    }
  });
  workers.parallel_for(rgb_height_, [&](size_t y) { resolve_row(range, splat_size, static_cast<uint32_t>(y), out + y * rgb_width_); });
}

}  // namespace simsense
