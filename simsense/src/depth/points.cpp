#include "depth/points.h"

#include <opencv2/calib3d.hpp>

#include "device/thread_pool.h"

namespace simsense {

PointMaker::PointMaker(const Pinhole& camera, uint32_t width, uint32_t height)
    : width_(width), height_(height), ray_x_(width), ray_y_(height) {
  for (uint32_t x = 0; x < width; ++x) ray_x_[x] = static_cast<float>((x - camera.cx) / camera.fx);
  for (uint32_t y = 0; y < height; ++y) ray_y_[y] = static_cast<float>((y - camera.cy) / camera.fy);
}

PointMaker::PointMaker(const simsense_camera& camera) : PointMaker(pinhole(camera), camera.width, camera.height) {
  if (!is_distorted(camera)) return;
  per_pixel_ = true;
  std::vector<cv::Point2d> rays;
  rays.reserve(size_t{width_} * height_);
  for (uint32_t y = 0; y < height_; ++y)
    for (uint32_t x = 0; x < width_; ++x) rays.emplace_back(x, y);
  const cv::Mat k(3, 3, CV_64F, const_cast<double*>(camera.k)), coefficients(1, 5, CV_64F, const_cast<double*>(camera.distortion));
  const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-10);
  cv::undistortPoints(rays, rays, k, coefficients, cv::noArray(), cv::noArray(), until);
  ray_x_.resize(rays.size());
  ray_y_.resize(rays.size());
  for (size_t i = 0; i < rays.size(); ++i) {
    ray_x_[i] = static_cast<float>(rays[i].x);
    ray_y_[i] = static_cast<float>(rays[i].y);
  }
}

void PointMaker::apply(const float* depth, const Plane& points, ptrdiff_t component_stride, ks::ThreadPool& workers) const {
  workers.parallel_for(height_, [&](size_t row) {
    const auto y = static_cast<uint32_t>(row);
    for (uint32_t x = 0; x < width_; ++x) {
      const size_t pixel = row * width_ + x;
      const float z = depth[pixel];
      const Plane point{points.data + x * points.pixel_stride + static_cast<ptrdiff_t>(y) * points.row_stride, 0, component_stride};
      point.set(0, 0, z * ray_x_[per_pixel_ ? pixel : x]);
      point.set(1, 0, z * ray_y_[per_pixel_ ? pixel : y]);
      point.set(2, 0, z);
    }
  });
}

void PointMaker::color(const float* depth, const ConstPlane& rgb, ptrdiff_t rgb_component_stride, const Plane& points,
                       ptrdiff_t component_stride, ks::ThreadPool& workers) const {
  workers.parallel_for(height_, [&](size_t row) {
    const auto y = static_cast<uint32_t>(row);
    for (uint32_t x = 0; x < width_; ++x) {
      const Plane point{points.data + x * points.pixel_stride + static_cast<ptrdiff_t>(y) * points.row_stride, 0, component_stride};
      for (uint32_t c = 0; c < 3; ++c) {
        const ConstPlane channel{rgb.data + static_cast<ptrdiff_t>(c) * rgb_component_stride, rgb.row_stride, rgb.pixel_stride, rgb.format};
        point.set(3 + c, 0, depth[row * width_ + x] > 0 ? static_cast<float>(channel.at<uint8_t>(x, y)) / 255.0f : 0.0f);
      }
    }
  });
}

}  // namespace simsense
