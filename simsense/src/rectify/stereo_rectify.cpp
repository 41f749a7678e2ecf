// SPDX-License-Identifier: Apache-2.0
#include "rectify/stereo_rectify.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "rig/rig.h"
#include "rig/rotation.h"

namespace simsense {
namespace {

struct Side {
  const simsense_camera& camera;
  Rotation to_rectified;
};

/// In single precision, see below.
struct Point {
  float x, y;
};

/// Through memory: GCC 12 at -O3 drops a narrowing whose result is widened again.
Point rounded(double x, double y) {
  const volatile float kept[2] = {static_cast<float>(x), static_cast<float>(y)};
  return {kept[0], kept[1]};
}

/// The conventions below are numbers of OpenCV's stereoRectify: it takes this many steps of the inverse lens, and keeps points in single
/// precision. Doing the same, pairs that were rectified with it stay as they were to the last bit.
constexpr int lens_steps = 5;

Normalised ray_of(const Side& side, const Point& pixel) { return ray_of_pixel_by_steps(side.camera, pixel.x, pixel.y, lens_steps); }

/// The place of a source camera's ray in an image of the rectified one.
Point landing(const Side& side, const Pinhole& rectified, const Normalised& ray) {
  const Vector3 turned = multiply(side.to_rectified, Vector3{ray[0], ray[1], 1});
  return rounded(rectified.fx * turned[0] / turned[2] + rectified.cx, rectified.fy * turned[1] / turned[2] + rectified.cy);
}

struct Centre {
  double x, y;
};

/// The centre that puts the mean of one image's corners into the middle of the rectified one.
Centre centre_px(const Side& side, double focal_px) {
  const auto right = static_cast<float>(side.camera.width - 1), bottom = static_cast<float>(side.camera.height - 1);
  const Pinhole around_zero{focal_px, focal_px, 0, 0};
  Centre sum{0, 0};
  for (const Point& corner : {Point{0, 0}, Point{right, 0}, Point{0, bottom}, Point{right, bottom}}) {
    const Normalised exact = ray_of(side, corner);
    const Point ray = rounded(exact[0], exact[1]), p = landing(side, around_zero, {ray.x, ray.y});
    sum = {sum.x + p.x, sum.y + p.y};
  }
  return {right / 2.0 - sum.x / 4, bottom / 2.0 - sum.y / 4};
}

struct Extent {
  float x0, y0, x1, y1;
};

/// The smallest rectangle around a grid of an image's points.
Extent extent(const Side& side, const Pinhole& rectified) {
  constexpr int last = 8;
  constexpr float far = std::numeric_limits<float>::max();
  Extent e{far, far, -far, -far};
  for (int i = 0; i <= last; ++i)
    for (int j = 0; j <= last; ++j) {
      const Point p =
          landing(side, rectified, ray_of(side, rounded(1.0 * side.camera.width * j / last, 1.0 * side.camera.height * i / last)));
      e = {std::min(e.x0, p.x), std::min(e.y0, p.y), std::max(e.x1, p.x), std::max(e.y1, p.y)};
    }
  return {e.x0, e.y0, e.x0 + (e.x1 - e.x0), e.y0 + (e.y1 - e.y0)};
}

/// By how much the focal length must shrink (or may grow) for that rectangle to fill the image, the principal point staying in place.
double fitting_scale(const Extent& e, const Pinhole& c, const simsense_camera& image) {
  return std::min(
      {c.cx / (c.cx - e.x0), c.cy / (c.cy - e.y0), (image.width - c.cx) / (e.x1 - c.cx), (image.height - c.cy) / (e.y1 - c.cy)});
}

}  // namespace

RectifiedPair rectify_pair(const simsense_camera& left, const simsense_camera& right, const Rigid& left_to_right, bool shrink) {
  Vector3 half = axis_angle_of(nearest_rotation(left_to_right.rotation));
  for (double& component : half) component *= -0.5;
  const Rotation right_half = rotation_about(half);
  // Both cameras are parallel now, and the right one stands at -t from the left.
  const Vector3 t = multiply(right_half, left_to_right.translation);
  const bool is_horizontal = std::abs(t[0]) > std::abs(t[1]);
  const size_t axis = is_horizontal ? 0 : 1;
  Vector3 along{};
  along[axis] = t[axis] > 0 ? 1 : -1;
  Vector3 turn = cross(t, along);
  const double sine = length(turn);
  if (sine > 0)
    for (double& component : turn) component *= std::acos(std::min(1.0, std::abs(t[axis]) / length(t))) / sine;
  const Rotation both = rotation_about(turn);
  const Side sides[2] = {{left, multiply(both, transposed(right_half))}, {right, multiply(both, right_half)}};
  const double focal = (left.k[4] + right.k[4]) / 2;
  const Centre centres[2] = {centre_px(sides[0], focal), centre_px(sides[1], focal)};
  RectifiedPair out{sides[0].to_rectified, sides[1].to_rectified, {}, 0, is_horizontal};
  out.camera = {focal, focal, (centres[0].x + centres[1].x) / 2, (centres[0].y + centres[1].y) / 2};
  if (shrink) {
    const double scale = std::min(fitting_scale(extent(sides[0], out.camera), out.camera, left),
                                  fitting_scale(extent(sides[1], out.camera), out.camera, left));
    out.camera.fx = out.camera.fy = focal * scale;
  }
  out.baseline_m = -multiply(sides[1].to_rectified, left_to_right.translation)[0];
  return out;
}

}  // namespace simsense
