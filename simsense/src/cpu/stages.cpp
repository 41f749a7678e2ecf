// SPDX-License-Identifier: Apache-2.0
#include "cpu/stages.h"

#include <algorithm>
#include <limits>

#include "cpu/checks/checks.h"
#include "cpu/depth/depth.h"
#include "cpu/rectify/remap.h"
#include "cpu/signal/imager.h"

namespace simsense {
namespace {

cpu::Irradiance light_of(const HostFrame& frame, uint32_t pair, uint32_t side) {
  cpu::Irradiance light{frame.inputs[side]->input(pair), std::nullopt};
  if (frame.lasers[side]) light.laser = frame.lasers[side]->input(pair);
  return light;
}

}  // namespace

CpuStages::CpuStages(const PreparedRig& rig, ks::ThreadPool& workers)
    : rig_(rig), workers_(workers), width_(rig.width()), height_(rig.height()) {
  if (rig.rgb) registration_.emplace(*rig.rgb, width_, height_);
}

void CpuStages::run(const StageSettings& settings, const HostFrame& frame, uint32_t pair, const std::function<void(float)>& progress) {
  call_.emplace(Call{settings, frame, pair, progress});
  run_stages(*this, settings, {frame, rig_.rgb.has_value()});
}

void CpuStages::signal() {
  for (const uint32_t side : {0u, 1u}) images_[side] = measure_side(side);
}

/// The image as the imager gives it: the caller's own pixels where nothing changes them.
ConstImage CpuStages::measure_side(uint32_t side) {
  const auto& [settings, frame, pair, progress] = *call_;
  const Imager& imager = settings.imagers[side];
  if (imager.is_wide()) return measure_wide(side);
  const uint32_t output = SIMSENSE_OUTPUT_IR_LEFT + side;
  const ConstPlane input = frame.inputs[side]->input(pair);
  ConstImage image{reinterpret_cast<const uint8_t*>(input.data), input.row_stride};
  if (input.format != KS_FORMAT_U8 || input.pixel_stride != 1 || !imager.is_neutral()) {
    uint8_t* counts = frame.target(output, pair, counts_[side], rig_.pixels());
    cpu::measure(imager, settings.noise_key(pair, side), light_of(frame, pair, side), width_, height_, counts, workers_);
    image = {counts, static_cast<ptrdiff_t>(width_)};
  }
  frame.store(output, pair, image.data, image.row_stride, width_, height_);
  return settings.wide ? widened(image, side) : image;
}

ConstImage CpuStages::measure_wide(uint32_t side) {
  const auto& [settings, frame, pair, progress] = *call_;
  const uint32_t output = SIMSENSE_OUTPUT_IR_LEFT + side;
  const auto pitch = static_cast<ptrdiff_t>(width_);
  uint16_t* counts = frame.target(output, pair, wide_counts_[side], rig_.pixels());
  cpu::measure(settings.imagers[side], settings.noise_key(pair, side), light_of(frame, pair, side), width_, height_, counts, workers_);
  frame.store_counts(output, pair, counts, pitch, width_, height_, settings.extra_bits);
  return {reinterpret_cast<const uint8_t*>(counts), pitch, 2};
}

/// The matcher wants both images alike: an 8-bit image beside a wider one.
ConstImage CpuStages::widened(ConstImage image, uint32_t side) {
  std::vector<uint16_t>& wide = wide_counts_[side];
  wide.resize(rig_.pixels());
  for (size_t y = 0; y < height_; ++y)
    std::copy_n(image.data + static_cast<ptrdiff_t>(y) * image.row_stride, width_, wide.data() + y * width_);
  return {reinterpret_cast<const uint8_t*>(wide.data()), static_cast<ptrdiff_t>(width_), 2};
}

void CpuStages::rectify() {
  for (const uint32_t side : {0u, 1u}) images_[side] = rectify_side(side);
}

ConstImage CpuStages::rectify_side(uint32_t side) {
  const auto& [settings, frame, pair, progress] = *call_;
  const uint32_t output = SIMSENSE_OUTPUT_RECTIFIED_LEFT + side;
  ConstImage image = images_[side];
  if (!rig_.rectification.is_identity()) {
    void* rectified = settings.wide ? static_cast<void*>(frame.target(output, pair, wide_rectified_[side], rig_.pixels()))
                                    : static_cast<void*>(frame.target(output, pair, rectified_[side], rig_.pixels()));
    const auto resample = settings.remaps_nearest ? remap_nearest : remap;
    resample(side == 0 ? rig_.rectification.left : rig_.rectification.right, image, rectified, workers_);
    image = {static_cast<const uint8_t*>(rectified), static_cast<ptrdiff_t>(width_), image.element_bytes};
  }
  if (settings.wide) {
    frame.store_counts(output, pair, reinterpret_cast<const uint16_t*>(image.data), image.row_stride, width_, height_, settings.extra_bits);
  } else {
    frame.store(output, pair, image.data, image.row_stride, width_, height_);
  }
  return image;
}

MatchStages& CpuStages::matcher() {
  const StageSettings& s = call_->settings;
  if (!matcher_ || !(matcher_parameters_ == s.match) || !(matcher_region_ == s.used)) {
    matcher_.emplace(s.used.x1 - s.used.x0, s.used.y1 - s.used.y0, s.match, workers_);
    matcher_parameters_ = s.match;
    matcher_region_ = s.used;
  }
  matcher_->set_progress(call_->progress);
  matcher_->set_noise(s.noise);
  open_maps();
  const auto part = [&](ConstImage image) {
    const ptrdiff_t first = static_cast<ptrdiff_t>(s.used.y0) * image.row_stride + static_cast<ptrdiff_t>(s.used.x0);
    return ConstImage{image.data + first * static_cast<ptrdiff_t>(image.element_bytes), image.row_stride, image.element_bytes};
  };
  matcher_->begin(part(images_[0]), part(images_[1]), s.is_partial ? region_maps() : maps_);
  return *matcher_;
}

void CpuStages::open_maps() {
  const auto& [settings, frame, pair, progress] = *call_;
  const size_t pixels = rig_.pixels();
  maps_ = frame.target(SIMSENSE_OUTPUT_DISPARITY, pair, disparity_, pixels);
  if (frame.wants(SIMSENSE_OUTPUT_CONFIDENCE)) maps_.confidence = frame.target(SIMSENSE_OUTPUT_CONFIDENCE, pair, confidence_, pixels);
  if (frame.wants(SIMSENSE_OUTPUT_REASON))
    maps_.reason = reinterpret_cast<MatchReason*>(frame.target(SIMSENSE_OUTPUT_REASON, pair, reason_, pixels));
}

MatchMaps CpuStages::region_maps() {
  const Region& used = call_->settings.used;
  region_disparity_.resize(size_t{used.x1 - used.x0} * (used.y1 - used.y0));
  region_confidence_.resize(region_disparity_.size());
  region_reason_.resize(region_disparity_.size());
  MatchMaps found = region_disparity_.data();
  if (maps_.confidence) found.confidence = region_confidence_.data();
  if (maps_.reason) found.reason = reinterpret_cast<MatchReason*>(region_reason_.data());
  return found;
}

void CpuStages::place_region() {
  const Region &used = call_->settings.used, &wanted = call_->settings.wanted;
  const size_t used_width = used.x1 - used.x0;
  const auto place = [&](auto* all, const auto* local, auto elsewhere) {
    if (!all) return;
    std::fill_n(all, rig_.pixels(), elsewhere);
    for (size_t y = wanted.y0; y < wanted.y1; ++y)
      std::copy_n(local + (y - used.y0) * used_width + (wanted.x0 - used.x0), wanted.x1 - wanted.x0, all + y * width_ + wanted.x0);
  };
  place(maps_.disparity, region_disparity_.data(), call_->settings.invalid_disparity());
  place(maps_.confidence, region_confidence_.data(), 0.0f);
  place(maps_.reason, reinterpret_cast<const MatchReason*>(region_reason_.data()), MatchReason::not_computed);
}

void CpuStages::drop_padding() { invalidate_outside(rig_.rectification.left, maps_, call_->settings.invalid_disparity(), workers_); }

void CpuStages::drop_low_texture() {
  const StageSettings& s = call_->settings;
  texture_check_.apply(s.texture, images_[0], width_, height_, maps_, s.invalid_disparity(), workers_);
}

void CpuStages::filter_speckles() {
  const StageSettings& s = call_->settings;
  speckle_filter_.apply(maps_, width_, height_, s.invalid_disparity(), s.speckle_max_size, s.speckle_max_diff_px, workers_);
}

void CpuStages::drop_edges() {
  const StageSettings& s = call_->settings;
  edge_check_.apply(s.edges, maps_, width_, height_, s.invalid_disparity(), workers_);
}

void CpuStages::fill_holes() {
  const StageSettings& s = call_->settings;
  simsense::fill_holes(s.hole_filling, maps_.disparity, width_, s.wanted, s.invalid_disparity(), workers_);
}

void CpuStages::depth() {
  const auto& [settings, frame, pair, progress] = *call_;
  frame.store_disparity(pair, maps_.disparity, width_, height_);
  if (!frame.wants(SIMSENSE_OUTPUT_DEPTH) && (rig_.rgb || !frame.wants_points())) return;
  float* depth = frame.target(SIMSENSE_OUTPUT_DEPTH, pair, depth_, rig_.pixels());
  depth_from_disparity(rig_.rectification.geometry, settings.depth_range, maps_.disparity, settings.invalid_disparity(), width_, height_,
                       depth, workers_);
  frame.store_depth(SIMSENSE_OUTPUT_DEPTH, pair, depth, width_, height_);
  points_depth_ = depth;
}

void CpuStages::registration() {
  // The range holds in the RGB camera's own frame, so that what lies outside it in the left frame still occludes.
  constexpr DepthRange everything{0, std::numeric_limits<float>::infinity()};
  const auto& [settings, frame, pair, progress] = *call_;
  const uint32_t width = rig_.rgb->width(), height = rig_.rgb->height();
  depth_.resize(rig_.pixels());
  float* depth_rgb = frame.target(SIMSENSE_OUTPUT_DEPTH_RGB, pair, depth_rgb_, size_t{width} * height);
  depth_from_disparity(rig_.rectification.geometry, everything, maps_.disparity, settings.invalid_disparity(), width_, height_,
                       depth_.data(), workers_);
  registration_->apply(depth_.data(), settings.depth_range, settings.splat, depth_rgb, workers_);
  frame.store_depth(SIMSENSE_OUTPUT_DEPTH_RGB, pair, depth_rgb, width, height);
  points_depth_ = depth_rgb;
}

void CpuStages::points() {
  const auto& [settings, frame, pair, progress] = *call_;
  const uint32_t width = rig_.rgb ? rig_.rgb->width() : width_, height = rig_.rgb ? rig_.rgb->height() : height_;
  for (const uint32_t output : {SIMSENSE_OUTPUT_POINTS, SIMSENSE_OUTPUT_POINTS_COLORED}) {
    if (!frame.wants(output)) continue;
    const HostImage& points = *frame.outputs[output];
    make_points(rig_.rays, points_depth_, width, height, points.output(pair), points.component_stride(), workers_);
    if (output == SIMSENSE_OUTPUT_POINTS_COLORED)
      color_points(points_depth_, width, height, frame.rgb->input(pair), frame.rgb->component_stride(), points.output(pair),
                   points.component_stride(), workers_);
  }
}

void CpuStages::reason() {
  const StageSettings& s = call_->settings;
  depth_.resize(rig_.pixels());
  depth_from_disparity(rig_.rectification.geometry, s.depth_range, maps_.disparity, s.invalid_disparity(), width_, height_, depth_.data(),
                       workers_);
  for (size_t i = 0; i < rig_.pixels(); ++i)
    if (maps_.reason[i] == MatchReason::valid && depth_[i] == 0) maps_.reason[i] = MatchReason::out_of_range;
  find_reasons(s.reason, images_[0], width_, height_, maps_.reason, workers_);
}

void CpuStages::store_maps() {
  const auto& [settings, frame, pair, progress] = *call_;
  if (maps_.confidence) frame.store(SIMSENSE_OUTPUT_CONFIDENCE, pair, maps_.confidence, width_, width_, height_);
  if (maps_.reason) frame.store(SIMSENSE_OUTPUT_REASON, pair, reinterpret_cast<const uint8_t*>(maps_.reason), width_, width_, height_);
}

}  // namespace simsense
