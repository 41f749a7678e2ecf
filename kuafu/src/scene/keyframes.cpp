// SPDX-License-Identifier: Apache-2.0
#include "scene/rig.h"

#include <algorithm>
#include <cmath>

namespace kuafu {
namespace {

double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0.0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

void normalise(std::span<double> v) {
  const double length = std::sqrt(dot(v, v));
  for (double& x : v) x = length > 0.0 ? x / length : 0.0;
  if (!(length > 0.0)) v.back() = 1.0;
}

/// Appendix C.3, the shorter way; along the chord where the two are so near that the arc is one.
void slerp(std::span<const double> from, std::span<const double> to, double t, std::span<double> out) {
  const double cosine = dot(from, to), sign = cosine < 0.0 ? -1.0 : 1.0, angle = std::acos(std::min(std::abs(cosine), 1.0));
  const bool near = angle < 1e-6;
  const double a = near ? 1.0 - t : std::sin(angle * (1.0 - t)) / std::sin(angle), b = near ? t : std::sin(angle * t) / std::sin(angle);
  for (size_t i = 0; i < out.size(); ++i) out[i] = a * from[i] + sign * b * to[i];
  normalise(out);
}

}  // namespace

void value_at(const Keyframes& k, double time_s, std::span<double> out) {
  const bool spline = k.interpolation == Keyframes::Interpolation::cubic_spline;
  const size_t width = k.width, stride = spline ? 3 * width : width;
  // Number `i` of what keyframe `key` has: 0 its in-tangent, 1 its value, 2 its out-tangent.
  const auto number = [&](size_t key, size_t part, size_t i) { return double{k.values[key * stride + (spline ? part * width : 0) + i]}; };
  const auto read = [&](size_t key, std::span<double> to) {
    for (size_t i = 0; i < width; ++i) to[i] = number(key, 1, i);
    if (k.quaternion) normalise(to);
  };
  const auto after = static_cast<size_t>(std::upper_bound(k.times_s.begin(), k.times_s.end(), time_s) - k.times_s.begin());
  if (after == 0) return read(0, out);
  const size_t key = after - 1;
  if (after == k.times_s.size() || k.interpolation == Keyframes::Interpolation::step) return read(key, out);
  const double span_s = double{k.times_s[after]} - double{k.times_s[key]}, t = (time_s - double{k.times_s[key]}) / span_s;
  if (spline) {  // appendix C.5
    const double t2 = t * t, t3 = t2 * t;
    for (size_t i = 0; i < width; ++i)
      out[i] = (2 * t3 - 3 * t2 + 1) * number(key, 1, i) + span_s * (t3 - 2 * t2 + t) * number(key, 2, i) +
               (3 * t2 - 2 * t3) * number(after, 1, i) + span_s * (t3 - t2) * number(after, 0, i);
    if (k.quaternion) normalise(out);
    return;
  }
  std::vector<double> to(width);
  read(key, out), read(after, to);
  if (k.quaternion) return slerp(std::vector<double>(out.begin(), out.end()), to, t, out);
  for (size_t i = 0; i < width; ++i) out[i] += t * (to[i] - out[i]);
}

}  // namespace kuafu
