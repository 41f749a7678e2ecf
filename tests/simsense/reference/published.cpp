// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/published.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace simsense::reference {
namespace {

using Image = std::vector<uint8_t>;
using Costs = std::vector<uint16_t>;  // [height][width][disparity]

struct Size {
  int w, h, d;
  [[nodiscard]] size_t at(int x, int y) const { return static_cast<size_t>(y) * static_cast<size_t>(w) + static_cast<size_t>(x); }
  [[nodiscard]] size_t at(int x, int y, int disparity) const { return at(x, y) * static_cast<size_t>(d) + static_cast<size_t>(disparity); }
};

cv::Mat matrix(const double* values, int rows, int columns) { return cv::Mat(rows, columns, CV_64F, const_cast<double*>(values)).clone(); }

struct Rectifier {
  cv::Mat r1, r2, p1, p2, q;
  explicit Rectifier(const simsense_rig_desc& rig) {
    const cv::Mat pose = matrix(rig.left_to_right, 4, 4);
    const cv::Size size(static_cast<int>(rig.left.width), static_cast<int>(rig.left.height));
    cv::stereoRectify(matrix(rig.left.k, 3, 3), cv::noArray(), matrix(rig.right.k, 3, 3), cv::noArray(), size, pose(cv::Rect(0, 0, 3, 3)),
                      pose(cv::Rect(3, 0, 1, 3)), r1, r2, p1, p2, q, cv::CALIB_ZERO_DISPARITY, 1.0, size);
  }
  [[nodiscard]] float focal_length() const { return static_cast<float>(q.at<double>(2, 3)); }
  [[nodiscard]] float baseline() const { return static_cast<float>(1.0 / q.at<double>(3, 2)); }
};

/// Nearest pixel, then into the image.
Image rectified(const Image& image, const Size& s, const simsense_camera& camera, const cv::Mat& rotation, const cv::Mat& projection) {
  cv::Mat map_x, map_y;
  cv::initUndistortRectifyMap(matrix(camera.k, 3, 3), cv::noArray(), rotation, projection, cv::Size(s.w, s.h), CV_32FC1, map_x, map_y);
  Image out(image.size());
  for (int y = 0; y < s.h; ++y)
    for (int x = 0; x < s.w; ++x) {
      const float column = std::round(map_x.at<float>(y, x)), row = std::round(map_y.at<float>(y, x));
      out[s.at(x, y)] = image[s.at(static_cast<int>(std::clamp(column, 0.0f, static_cast<float>(s.w - 1))),
                                   static_cast<int>(std::clamp(row, 0.0f, static_cast<float>(s.h - 1))))];
    }
  return out;
}

std::vector<uint32_t> census(const Image& image, const Size& s, int window_w, int window_h) {
  const auto value = [&](int x, int y) { return x < 0 || y < 0 || x >= s.w || y >= s.h ? 0 : image[s.at(x, y)]; };
  std::vector<uint32_t> words(image.size());
  for (int y = 0; y < s.h; ++y)
    for (int x = 0; x < s.w; ++x)
      for (int bit = 0; bit < window_w * window_h / 2; ++bit) {
        const int dx = bit % window_w - window_w / 2, dy = bit / window_w - window_h / 2;
        words[s.at(x, y)] |= static_cast<uint32_t>(value(x + dx, y + dy) >= value(x - dx, y - dy)) << bit;
      }
  return words;
}

Costs hamming(const std::vector<uint32_t>& left, const std::vector<uint32_t>& right, const Size& s) {
  Costs cost(left.size() * static_cast<size_t>(s.d));
  for (int y = 0; y < s.h; ++y)
    for (int x = 0; x < s.w; ++x)
      for (int d = 0; d < s.d; ++d)
        cost[s.at(x, y, d)] = static_cast<uint16_t>(std::popcount(left[s.at(x, y)] ^ right[s.at(std::max(x - d, 0), y)]));
  return cost;
}

Costs block_sum(const Costs& cost, const Size& s, int block_w, int block_h) {
  Costs sum(cost.size());
  const auto image = [&](const Costs& costs) { return cv::Mat(s.h, s.w, CV_16UC(s.d), const_cast<uint16_t*>(costs.data())); };
  cv::boxFilter(image(cost), image(sum), -1, {block_w, block_h}, {-1, -1}, false, cv::BORDER_REPLICATE);
  return sum;
}

/// Adds one path's costs to the sum, from its first pixel on.
void follow(const Costs& cost, const Size& s, int p1, int p2, int x, int y, int dx, int dy, std::vector<int>& sum) {
  std::vector<int> before, now(static_cast<size_t>(s.d));
  for (; x >= 0 && y >= 0 && x < s.w && y < s.h; x += dx, y += dy) {
    const int lowest = before.empty() ? 0 : *std::min_element(before.begin(), before.end());
    for (int d = 0; d < s.d; ++d) {
      const auto last = [&](int k) { return before[static_cast<size_t>(k)]; };
      int least = 0;
      if (!before.empty()) {
        const int left = d > 0 ? last(d - 1) : last(d + 1), right = d < s.d - 1 ? last(d + 1) : last(d - 1);
        least = std::min({last(d), left + p1, right + p1, lowest + p2}) - lowest;
      }
      now[static_cast<size_t>(d)] = cost[s.at(x, y, d)] + least;
      sum[s.at(x, y, d)] += now[static_cast<size_t>(d)];
    }
    before = now;
  }
}

std::vector<int> aggregated(const Costs& cost, const Size& s, int p1, int p2) {
  std::vector<int> sum(cost.size());
  for (int y = 0; y < s.h; ++y) {
    follow(cost, s, p1, p2, 0, y, 1, 0, sum);
    follow(cost, s, p1, p2, s.w - 1, y, -1, 0, sum);
  }
  for (int x = 0; x < s.w; ++x) {
    follow(cost, s, p1, p2, x, 0, 0, 1, sum);
    follow(cost, s, p1, p2, x, s.h - 1, 0, -1, sum);
  }
  for (int& value : sum) value /= 4;
  return sum;
}

/// Winner, uniqueness and parabola of one pixel.
float left_disparity(const int* cost, int disparities, int ratio) {
  const int best = static_cast<int>(std::min_element(cost, cost + disparities) - cost);
  for (int d = 0; d < disparities; ++d)
    if (std::abs(d - best) > 1 && cost[d] * (100 - ratio) < cost[best] * 100) return -1;
  if (best == 0 || best == disparities - 1) return static_cast<float>(best);
  const double slope = cost[best + 1] - cost[best - 1], curvature = cost[best - 1] - 2 * cost[best] + cost[best + 1];
  return static_cast<float>(best) - static_cast<float>(slope / (2.0 * curvature));
}

int right_disparity(const std::vector<int>& cost, const Size& s, int x, int y) {
  int best = 0;
  for (int d = 1; d < s.d && x + d < s.w; ++d)
    if (cost[s.at(x + d, y, d)] < cost[s.at(x + best, y, best)]) best = d;
  return best;
}

std::vector<float> disparities(const std::vector<int>& cost, const Size& s, const simsense_parameters& p) {
  std::vector<float> disparity(static_cast<size_t>(s.w) * static_cast<size_t>(s.h));
  for (int y = 0; y < s.h; ++y)
    for (int x = 0; x < s.w; ++x) {
      float& value = disparity[s.at(x, y)];
      value = left_disparity(&cost[s.at(x, y, 0)], s.d, static_cast<int>(p.uniqueness_ratio));
      if (p.lr_max_diff < 0) continue;
      const int whole = static_cast<int>(std::round(value));
      if (whole < 0 || x - whole < 0 || std::abs(whole - right_disparity(cost, s, x - whole, y)) > p.lr_max_diff) value = -1;
    }
  return disparity;
}

std::vector<float> median(const std::vector<float>& in, const Size& s, int size) {
  std::vector<float> out = in;
  const int half = size / 2;
  for (int y = half; y < s.h - half; ++y)
    for (int x = half; x < s.w - half; ++x) {
      std::vector<float> window;
      for (int k = 0; k < size * size; ++k) window.push_back(in[s.at(x - half + k % size, y - half + k / size)]);
      std::sort(window.begin(), window.end());
      out[s.at(x, y)] = window[window.size() / 2];
    }
  return out;
}

/// Every left pixel, measured or not, lands on one RGB pixel; the nearest one stays. The z-buffer starts at the largest depth.
std::vector<float> registered(const std::vector<float>& depth, const Size& s, const simsense_rig_desc& rig, const simsense_parameters& p) {
  const cv::Mat pose = matrix(rig.left_to_rgb, 4, 4), k = matrix(rig.rgb.k, 3, 3);
  const cv::Mat a = k * pose(cv::Rect(0, 0, 3, 3)) * matrix(rig.left.k, 3, 3).inv();
  const cv::Mat b = k * pose(cv::Rect(3, 0, 1, 3));
  const Size rgb{static_cast<int>(rig.rgb.width), static_cast<int>(rig.rgb.height), 1};
  std::vector<float> out(static_cast<size_t>(rgb.w) * static_cast<size_t>(rgb.h), p.max_depth_m);
  for (int y = 0; y < s.h; ++y)
    for (int x = 0; x < s.w; ++x) {
      float seen[3];
      for (int i = 0; i < 3; ++i) {
        const double ray = a.at<double>(i, 0) * x + a.at<double>(i, 1) * y + a.at<double>(i, 2);
        seen[i] = std::fma(static_cast<float>(ray), depth[s.at(x, y)], static_cast<float>(b.at<double>(i)));
      }
      const float column = std::round(seen[0] / seen[2]), row = std::round(seen[1] / seen[2]);
      if (!(seen[2] > 0) || !(column >= 0 && row >= 0 && column < static_cast<float>(rgb.w) && row < static_cast<float>(rgb.h))) continue;
      float& cell = out[rgb.at(static_cast<int>(column), static_cast<int>(row))];
      cell = std::min(cell, seen[2]);
    }
  cv::Mat image(rgb.h, rgb.w, CV_32F, out.data());
  if (p.depth_dilation != 0) cv::erode(image, image, cv::Mat::ones(2, 2, CV_8U), {0, 0});  // the nearest of a pixel, right and below
  return out;
}

}  // namespace

std::vector<float> published_depth(const simsense_rig_desc& rig, const simsense_parameters& p, const Image& left, const Image& right) {
  const Size s{static_cast<int>(rig.left.width), static_cast<int>(rig.left.height), static_cast<int>(p.max_disparity)};
  const Rectifier rectifier(rig);
  const Image l = rig.rectified ? left : rectified(left, s, rig.left, rectifier.r1, rectifier.p1);
  const Image r = rig.rectified ? right : rectified(right, s, rig.right, rectifier.r2, rectifier.p2);
  const int census_w = static_cast<int>(p.census_width), census_h = static_cast<int>(p.census_height);
  const int block_w = static_cast<int>(p.block_width), block_h = static_cast<int>(p.block_height), area = block_w * block_h;
  const Costs cost = block_sum(hamming(census(l, s, census_w, census_h), census(r, s, census_w, census_h), s), s, block_w, block_h);
  const auto sums = aggregated(cost, s, static_cast<int>(p.p1) * area, static_cast<int>(p.p2) * area);
  const std::vector<float> disparity = median(disparities(sums, s, p), s, static_cast<int>(p.median_size));
  std::vector<float> depth(disparity.size());
  const float focal_baseline = rectifier.focal_length() * rectifier.baseline();
  for (size_t i = 0; i < depth.size(); ++i) depth[i] = disparity[i] <= 0 ? 0 : focal_baseline / disparity[i];
  if (rig.rgb.width != 0) depth = registered(depth, s, rig, p);
  for (float& z : depth)
    if (z < p.min_depth_m || z >= p.max_depth_m) z = 0;
  return depth;
}

}  // namespace simsense::reference
