// Depth image to points: (x, y, z) = z * ray(pixel), 0,0,0 where there is no depth.
// Thread rule: immutable once made; the result does not depend on the number of workers.
#pragma once

#include <vector>

#include "image_view.h"
#include "rectify/rig.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

class PointMaker {
 public:
  /// A pinhole without distortion.
  PointMaker(const Pinhole& camera, uint32_t width, uint32_t height);
  /// A camera as it is: the ray of each pixel is undistorted once.
  explicit PointMaker(const simsense_camera& camera);

  /// depth: packed [height][width] metres. points: the x of pixel (0, 0); component_stride is from x to y to z, in bytes.
  void apply(const float* depth, const Plane& points, ptrdiff_t component_stride, ks::ThreadPool& workers) const;
  /// Components 3..5 of each point: red, green, blue of the same pixel of an 8-bit image, 0..1; 0 where there is no depth.
  void color(const float* depth, const ConstPlane& rgb, ptrdiff_t rgb_component_stride, const Plane& points, ptrdiff_t component_stride,
             ks::ThreadPool& workers) const;

  /// Rays at z = 1: of each column and each row, or where has_ray_per_pixel() of each pixel, [height][width].
  [[nodiscard]] const std::vector<float>& ray_x() const { return ray_x_; }
  [[nodiscard]] const std::vector<float>& ray_y() const { return ray_y_; }
  [[nodiscard]] bool has_ray_per_pixel() const { return per_pixel_; }

 private:
  uint32_t width_, height_;
  std::vector<float> ray_x_, ray_y_;  // at z = 1; one row and one column for a pinhole, one per pixel for a distorted camera
  bool per_pixel_ = false;
};

}  // namespace simsense
