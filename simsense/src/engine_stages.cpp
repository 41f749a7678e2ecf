// The stages of one pair, in the order of the light.
#include <algorithm>
#include <limits>

#include "device/thread_pool.h"
#include "disparity/reason.h"
#include "engine.h"
#include "rectify/remap.h"

namespace simsense {
namespace {

Irradiance light(const Frame& frame, uint32_t n, uint32_t eye) {
  Irradiance light{frame.inputs[eye]->input(n), std::nullopt};
  if (frame.lasers[eye]) light.laser = frame.lasers[eye]->input(n);
  return light;
}

}  // namespace

NoiseKey Engine::noise_key(uint32_t n, uint32_t eye) const {
  const simsense_signal& s = signal(eye);
  return {parameters_.noise_seed, parameters_.frame_index, s.scene_index, s.first_view + n, eye};
}

/// The image as the imager gives it: the caller's own pixels where nothing changes them.
ConstImage Engine::measure_eye(Frame& frame, uint32_t n, uint32_t eye) {
  const Imager& imager = imagers_[eye];
  if (imager.is_wide()) return measure_wide(frame, n, eye);
  const uint32_t output = SIMSENSE_OUTPUT_IR_LEFT + eye;
  const ConstPlane input = frame.inputs[eye]->input(n);
  ConstImage image{reinterpret_cast<const uint8_t*>(input.data), input.row_stride};
  if (input.format != KS_FORMAT_U8 || input.pixel_stride != 1 || !imager.is_neutral()) {
    uint8_t* counts = frame.target(output, n, counts_[eye], size_t{width_} * height_);
    imager.measure(noise_key(n, eye), light(frame, n, eye), width_, height_, counts, workers_);
    image = {counts, static_cast<ptrdiff_t>(width_)};
  }
  frame.store(output, n, image.data, image.row_stride, width_, height_);
  return is_wide() ? widened(image, eye) : image;
}

ConstImage Engine::measure_wide(Frame& frame, uint32_t n, uint32_t eye) {
  const uint32_t output = SIMSENSE_OUTPUT_IR_LEFT + eye;
  const auto pitch = static_cast<ptrdiff_t>(width_);
  uint16_t* counts = frame.target(output, n, wide_counts_[eye], size_t{width_} * height_);
  imagers_[eye].measure(noise_key(n, eye), light(frame, n, eye), width_, height_, counts, workers_);
  frame.store(output, n, counts, pitch, width_, height_);
  return {reinterpret_cast<const uint8_t*>(counts), pitch, 2};
}

/// The matcher wants both eyes alike: an 8-bit image beside a wider one.
ConstImage Engine::widened(ConstImage image, uint32_t eye) {
  std::vector<uint16_t>& wide = wide_counts_[eye];
  wide.resize(size_t{width_} * height_);
  for (size_t y = 0; y < height_; ++y)
    std::copy_n(image.data + static_cast<ptrdiff_t>(y) * image.row_stride, width_, wide.data() + y * width_);
  return {reinterpret_cast<const uint8_t*>(wide.data()), static_cast<ptrdiff_t>(width_), 2};
}

ConstImage Engine::prepare_eye(Frame& frame, uint32_t n, uint32_t eye) {
  ConstImage image;
  clock_.measure("signal", [&] { image = measure_eye(frame, n, eye); });
  const uint32_t output = SIMSENSE_OUTPUT_RECTIFIED_LEFT + eye;
  const size_t pixels = size_t{width_} * height_;
  clock_.measure("rectify", [&] {
    if (!rectification_.is_identity()) {
      void* rectified = is_wide() ? static_cast<void*>(frame.target(output, n, wide_rectified_[eye], pixels))
                                  : static_cast<void*>(frame.target(output, n, rectified_[eye], pixels));
      const auto resample = rig_.faults & SIMSENSE_FAULT_REMAP_NEAREST ? remap_nearest : remap;
      resample(eye == 0 ? rectification_.left : rectification_.right, image, rectified, workers_);
      image = {static_cast<const uint8_t*>(rectified), static_cast<ptrdiff_t>(width_), image.element_bytes};
    }
    if (is_wide()) {
      frame.store(output, n, reinterpret_cast<const uint16_t*>(image.data), image.row_stride, width_, height_);
    } else {
      frame.store(output, n, image.data, image.row_stride, width_, height_);
    }
  });
  return image;
}

void Engine::match(ConstImage left, ConstImage right, const MatchMaps& maps, const std::function<void(float)>& tell) {
  const Region wanted = region(parameters_);
  const Region used = reach(wanted);
  if (!matcher_) matcher_ = make_cpu_matcher(used.x1 - used.x0, used.y1 - used.y0, match_parameters(parameters_), workers_);
  matcher_->set_progress(tell);
  if (used == Region{0, 0, width_, height_} && wanted == used) {
    matcher_->match(left, right, maps);
  } else {
    match_region(left, right, wanted, maps);
  }
  for (const ks_stage_time& stage : matcher_->stage_times()) clock_.add(stage.name, stage.milliseconds);
}

MatchMaps Engine::open_maps(Frame& frame, uint32_t n) {
  const size_t pixels = size_t{width_} * height_;
  MatchMaps maps = frame.target(SIMSENSE_OUTPUT_DISPARITY, n, disparity_, pixels);
  if (frame.wants(SIMSENSE_OUTPUT_CONFIDENCE)) maps.confidence = frame.target(SIMSENSE_OUTPUT_CONFIDENCE, n, confidence_, pixels);
  if (frame.wants(SIMSENSE_OUTPUT_REASON))
    maps.reason = reinterpret_cast<MatchReason*>(frame.target(SIMSENSE_OUTPUT_REASON, n, reason_, pixels));
  return maps;
}

/// What follows from a pair's disparities.
void Engine::finish_pair(Frame& frame, uint32_t n, const MatchMaps& maps) {
  clean(maps);
  frame.store_disparity(n, maps.disparity, width_, height_);
  if (maps.confidence) frame.store(SIMSENSE_OUTPUT_CONFIDENCE, n, maps.confidence, width_, width_, height_);
  if (frame.wants(SIMSENSE_OUTPUT_DEPTH) || (frame.wants_points() && !has_rgb_)) make_depth(frame, n, maps.disparity);
  if (frame.wants(SIMSENSE_OUTPUT_DEPTH_RGB) || (frame.wants_points() && has_rgb_)) make_registered(frame, n, maps.disparity);
}

/// Disparities of a region follow from its own columns and those that lie as far to the left (or right) as the disparities reach, and from
/// some surroundings that steer the paths.
Region Engine::reach(const Region& r) const {
  constexpr int32_t surroundings = 16, smallest = 32;
  const MatchParameters p = match_parameters(parameters_);
  const auto half = [](uint32_t census, uint32_t block, uint32_t median) { return static_cast<int32_t>((census + block + median) / 2); };
  const int32_t farthest = std::max(0, p.min_disparity + static_cast<int32_t>(p.max_disparity)), nearest = std::max(0, -p.min_disparity);
  const uint32_t margin = p.census_contrast > 0 ? 2 * MatchParameters::contrast_margin : 0;
  const int32_t dx = surroundings + half(p.census_width + margin, p.block_width, p.median_size);
  const int32_t dy = surroundings + half(p.census_height + margin, p.block_height, p.median_size);
  const auto widened = [](uint32_t begin, uint32_t end, int32_t before, int32_t after, uint32_t size) {
    const auto lower = static_cast<uint32_t>(std::max(0, static_cast<int32_t>(begin) - before));
    const auto upper = std::max(std::min(size, end + static_cast<uint32_t>(after)), lower + smallest);
    return std::pair{upper > size ? size - smallest : lower, std::min(size, upper)};
  };
  const auto [x0, x1] = widened(r.x0, r.x1, dx + farthest, dx + nearest, width_);
  const auto [y0, y1] = widened(r.y0, r.y1, dy, dy, height_);
  return {x0, y0, x1, y1};
}

void Engine::match_region(ConstImage left, ConstImage right, const Region& wanted, const MatchMaps& maps) {
  const Region used = reach(wanted);
  const size_t pixels = size_t{width_} * height_, used_width = used.x1 - used.x0;
  const auto part = [&](ConstImage image) {
    const ptrdiff_t first = static_cast<ptrdiff_t>(used.y0) * image.row_stride + static_cast<ptrdiff_t>(used.x0);
    return ConstImage{image.data + first * static_cast<ptrdiff_t>(image.element_bytes), image.row_stride, image.element_bytes};
  };
  region_disparity_.resize(used_width * (used.y1 - used.y0));
  region_confidence_.resize(region_disparity_.size());
  region_reason_.resize(region_disparity_.size());
  MatchMaps found = region_disparity_.data();
  if (maps.confidence) found.confidence = region_confidence_.data();
  if (maps.reason) found.reason = reinterpret_cast<MatchReason*>(region_reason_.data());
  matcher_->match(part(left), part(right), found);
  const auto place = [&](auto* all, const auto* local, auto elsewhere) {
    if (!all) return;
    std::fill_n(all, pixels, elsewhere);
    for (size_t y = wanted.y0; y < wanted.y1; ++y)
      std::copy_n(local + (y - used.y0) * used_width + (wanted.x0 - used.x0), wanted.x1 - wanted.x0, all + y * width_ + wanted.x0);
  };
  place(maps.disparity, found.disparity, match_parameters(parameters_).invalid_disparity());
  place(maps.confidence, found.confidence, 0.0f);
  place(maps.reason, found.reason, MatchReason::not_computed);
}

/// What follows the matcher on disparities.
void Engine::clean(const MatchMaps& maps) {
  const float invalid = match_parameters(parameters_).invalid_disparity();
  const auto drop_padding = [&] {
    if (rectification_.is_identity() || (rig_.faults & SIMSENSE_FAULT_PADDING_MATCHED)) return;
    clock_.measure("rectify", [&] { invalidate_outside(rectification_.left, maps, invalid, workers_); });
  };
  drop_padding();
  if (parameters_.speckle_max_size > 0) {
    clock_.measure("speckle filter", [&] {
      speckle_filter_.apply(maps, width_, height_, invalid, parameters_.speckle_max_size, parameters_.speckle_max_diff_px, workers_);
    });
  }
  if (parameters_.hole_filling == SIMSENSE_HOLES_KEEP) return;
  const HoleFilling filling = parameters_.hole_filling == SIMSENSE_HOLES_LEFT ? HoleFilling::left : HoleFilling::background;
  clock_.measure("hole filling", [&] { fill_holes(filling, maps.disparity, width_, region(parameters_), invalid, workers_); });
  drop_padding();
}

void Engine::make_depth(Frame& frame, uint32_t n, const float* disparity) {
  float* depth = frame.target(SIMSENSE_OUTPUT_DEPTH, n, depth_, size_t{width_} * height_);
  const float invalid = match_parameters(parameters_).invalid_disparity();
  clock_.measure("depth", [&] {
    depth_from_disparity(geometry(), depth_range(parameters_), disparity, invalid, width_, height_, depth, workers_);
    frame.store_depth(SIMSENSE_OUTPUT_DEPTH, n, depth, width_, height_);
  });
  if (!frame.wants(SIMSENSE_OUTPUT_POINTS) || has_rgb_) return;
  const ImageAccess& points = *frame.outputs[SIMSENSE_OUTPUT_POINTS];
  clock_.measure("points", [&] { points_.apply(depth, points.output(n), points.component_stride(), workers_); });
}

void Engine::explain(Frame& frame, uint32_t n, ConstImage left, const MatchMaps& maps) {
  const size_t pixels = size_t{width_} * height_;
  MatchReason* reason = maps.reason;
  depth_.resize(pixels);
  clock_.measure("reason", [&] {
    depth_from_disparity(geometry(), depth_range(parameters_), maps.disparity, match_parameters(parameters_).invalid_disparity(), width_,
                         height_, depth_.data(), workers_);
    for (size_t i = 0; i < pixels; ++i)
      if (reason[i] == MatchReason::valid && depth_[i] == 0) reason[i] = MatchReason::out_of_range;
    const ReasonParameters window{parameters_.census_width, parameters_.census_height, parameters_.low_texture_dn,
                                  (1u << signal(0).bit_depth) - 1};
    explain_invalid(window, left, width_, height_, reason, workers_);
    frame.store(SIMSENSE_OUTPUT_REASON, n, reinterpret_cast<const uint8_t*>(reason), width_, width_, height_);
  });
}

void Engine::make_registered(Frame& frame, uint32_t n, const float* disparity) {
  // The range holds in the RGB camera's own frame, so that what lies outside it in the left frame still occludes.
  constexpr DepthRange everything{0, std::numeric_limits<float>::infinity()};
  const float invalid = match_parameters(parameters_).invalid_disparity();
  const uint32_t splat_size = std::max({1u, parameters_.splat_size, parameters_.depth_dilation != 0 ? 2u : 1u});
  depth_.resize(size_t{width_} * height_);
  float* depth_rgb = frame.target(SIMSENSE_OUTPUT_DEPTH_RGB, n, depth_rgb_, size_t{rig_.rgb.width} * rig_.rgb.height);
  clock_.measure("registration", [&] {
    depth_from_disparity(geometry(), everything, disparity, invalid, width_, height_, depth_.data(), workers_);
    registration_->apply(depth_.data(), depth_range(parameters_), splat_size, depth_rgb, workers_);
    frame.store_depth(SIMSENSE_OUTPUT_DEPTH_RGB, n, depth_rgb, rig_.rgb.width, rig_.rgb.height);
  });
  clock_.measure("points", [&] {
    for (const uint32_t output : {SIMSENSE_OUTPUT_POINTS, SIMSENSE_OUTPUT_POINTS_COLORED}) {
      if (!frame.wants(output)) continue;
      const ImageAccess& points = *frame.outputs[output];
      points_.apply(depth_rgb, points.output(n), points.component_stride(), workers_);
      if (output == SIMSENSE_OUTPUT_POINTS_COLORED)
        points_.color(depth_rgb, frame.rgb->input(n), frame.rgb->component_stride(), points.output(n), points.component_stride(), workers_);
    }
  });
}

}  // namespace simsense
