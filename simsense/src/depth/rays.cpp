#include "depth/rays.h"

#include <opencv2/calib3d.hpp>

namespace simsense {

PixelRays::PixelRays(const Pinhole& camera, uint32_t width, uint32_t height) : x_(width), y_(height) {
  for (uint32_t x = 0; x < width; ++x) x_[x] = static_cast<float>((x - camera.cx) / camera.fx);
  for (uint32_t y = 0; y < height; ++y) y_[y] = static_cast<float>((y - camera.cy) / camera.fy);
}

PixelRays::PixelRays(const simsense_camera& camera) : PixelRays(pinhole(camera), camera.width, camera.height) {
  if (!is_distorted(camera)) return;
  per_pixel_ = true;
  std::vector<cv::Point2d> rays;
  rays.reserve(size_t{camera.width} * camera.height);
  for (uint32_t y = 0; y < camera.height; ++y)
    for (uint32_t x = 0; x < camera.width; ++x) rays.emplace_back(x, y);
  const cv::Mat k(3, 3, CV_64F, const_cast<double*>(camera.k)), coefficients(1, 5, CV_64F, const_cast<double*>(camera.distortion));
  const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-10);
  cv::undistortPoints(rays, rays, k, coefficients, cv::noArray(), cv::noArray(), until);
  x_.resize(rays.size());
  y_.resize(rays.size());
  for (size_t i = 0; i < rays.size(); ++i) {
    x_[i] = static_cast<float>(rays[i].x);
    y_[i] = static_cast<float>(rays[i].y);
  }
}

}  // namespace simsense
