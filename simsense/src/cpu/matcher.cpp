// SPDX-License-Identifier: Apache-2.0
#include "cpu/matcher.h"

#include <algorithm>

#include "cpu/checks/median.h"
#include "cpu/sgm/sgm.h"

namespace simsense {

CpuMatcher::CpuMatcher(uint32_t width, uint32_t height, const MatchParameters& p, ks::ThreadPool& workers)
    : width_(width),
      height_(height),
      parameters_(p),
      workers_(workers),
      padded_{{width, height, 1, p.census_contrast_256ths > 0}, {width, height, 1, p.census_contrast_256ths > 0}},
      census_{{width, height, p.census_bits(), cpu::left_reach(p)}, {width, height, p.census_bits(), cpu::left_reach(p), p.min_disparity}},
      penalties_(width, height, p),
      aggregation_(cpu::make_aggregation(census_[0], census_[1], penalties_, width, height, p, workers.size())),
      unfiltered_(size_t{width} * height) {}

void CpuMatcher::begin(ConstImage left, ConstImage right, const MatchMaps& maps) {
  images_[0] = left;
  images_[1] = right;
  maps_ = maps;
}

void CpuMatcher::match(ConstImage left, ConstImage right, const MatchMaps& maps) {
  clock_.reset();
  begin(left, right, maps);
  run_match(*this, [this](const char* name, const auto& run) { clock_.measure(name, run); });
}

void CpuMatcher::census() {
  transform(0);
  transform(1);
  if (!penalties_.uniform()) for_rows([&](size_t begin, size_t end) { penalties_.compute_rows(padded_[0], begin, end); });
}

void CpuMatcher::transform(size_t side) {
  const ConstImage& image = images_[side];
  if (padded_[side].element_bytes() != image.element_bytes)
    padded_[side] = {width_, height_, image.element_bytes, parameters_.census_contrast_256ths > 0};
  for_rows([&](size_t begin, size_t end) { padded_[side].copy_rows(image, begin, end); });
  for_rows([&](size_t begin, size_t end) { cpu::census_rows(padded_[side], parameters_, begin, end, census_[side]); });
}

void CpuMatcher::sgm() {
  const size_t sweeps = aggregation_->sweep_count();
  cpu::Progress progress(progress_, 0.0f, 0.25f, sweeps);
  workers_.parallel_for(sweeps, [&](size_t i) { aggregation_->sweep(i, progress); });
}

void CpuMatcher::winner() {
  MatchMaps unfiltered = maps_;
  unfiltered.disparity = unfiltered_.data();
  cpu::Progress progress(progress_, 0.25f, 1.0f, aggregation_->strip_count());
  workers_.parallel_for(aggregation_->band_count(), [&](size_t i) { aggregation_->match_band(i, unfiltered, progress); });
}

void CpuMatcher::checks() {
  for_rows([&](size_t begin, size_t end) {
    cpu::median_rows(unfiltered_.data(), width_, height_, parameters_.median_size, begin, end, maps_.disparity);
    follow_median(begin * width_, end * width_);
  });
}

void CpuMatcher::keep_disparities() {
  for_rows([&](size_t begin, size_t end) {
    std::copy_n(maps_.disparity + begin * width_, (end - begin) * width_, unfiltered_.data() + begin * width_);
  });
}

void CpuMatcher::refine() {
  keep_disparities();
  refinement_.apply(parameters_, images_[0], images_[1], width_, height_, unfiltered_.data(), maps_.disparity, workers_);
}

void CpuMatcher::detection() {
  keep_disparities();
  detection_.apply(parameters_, images_[0], images_[1], width_, height_, unfiltered_.data(), noise_, maps_, workers_);
}

/// The other maps tell of the disparity after the median.
void CpuMatcher::follow_median(size_t begin, size_t end) const {
  for (size_t i = begin; i < end && (maps_.reason || maps_.confidence); ++i) {
    const bool valid = maps_.disparity[i] != parameters_.invalid_disparity();
    if (maps_.confidence && !valid) maps_.confidence[i] = 0;
    if (!maps_.reason) continue;
    if (valid) maps_.reason[i] = MatchReason::valid;
    if (!valid && maps_.reason[i] == MatchReason::valid) maps_.reason[i] = MatchReason::isolated;
  }
}

void CpuMatcher::for_rows(const std::function<void(size_t begin, size_t end)>& run) {
  constexpr size_t rows = 32;
  workers_.parallel_for((height_ + rows - 1) / rows, [&](size_t i) { run(i * rows, std::min((i + 1) * rows, height_)); });
}

std::unique_ptr<Matcher> make_cpu_matcher(uint32_t width, uint32_t height, const MatchParameters& parameters, ks::ThreadPool& workers) {
  return std::make_unique<CpuMatcher>(width, height, parameters, workers);
}

}  // namespace simsense
