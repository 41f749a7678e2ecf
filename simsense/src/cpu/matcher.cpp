// The CPU matcher: census, aggregation and median over a device's worker threads.
#include "matcher.h"

#include <algorithm>
#include <chrono>
#include <cstring>

#include "cpu/census.h"
#include "cpu/median.h"
#include "cpu/sgm.h"
#include "device/thread_pool.h"

namespace simsense {
namespace {

class CpuMatcher final : public Matcher {
 public:
  CpuMatcher(uint32_t width, uint32_t height, const MatchParameters& p, ks::ThreadPool& workers)
      : width_(width),
        height_(height),
        parameters_(p),
        workers_(workers),
        images_{{width, height, 1, p.census_contrast > 0}, {width, height, 1, p.census_contrast > 0}},
        census_{{width, height, p.census_bits(), cpu::left_reach(p)},
                {width, height, p.census_bits(), cpu::left_reach(p), p.min_disparity}},
        penalties_(width, height, p),
        aggregation_(cpu::make_aggregation(census_[0], census_[1], penalties_, width, height, p, workers.size())),
        unfiltered_(size_t{width} * height) {}

  void match(ConstImage left, ConstImage right, const MatchMaps& maps) override {
    times_.clear();
    timed("census", [&] {
      transform(left, 0);
      transform(right, 1);
      if (!penalties_.uniform()) for_rows([&](size_t begin, size_t end) { penalties_.compute_rows(images_[0], begin, end); });
    });
    MatchMaps unfiltered = maps;
    unfiltered.disparity = unfiltered_.data();
    const size_t sweeps = aggregation_->sweep_count(), bands = aggregation_->band_count();
    cpu::Progress sweeping(progress_, 0.0f, 0.25f, sweeps), matching(progress_, 0.25f, 1.0f, aggregation_->strip_count());
    timed("vertical paths", [&] { workers_.parallel_for(sweeps, [&](size_t i) { aggregation_->sweep(i, sweeping); }); });
    timed("aggregation and winner",
          [&] { workers_.parallel_for(bands, [&](size_t i) { aggregation_->match_band(i, unfiltered, matching); }); });
    timed("median", [&] {
      for_rows([&](size_t begin, size_t end) {
        cpu::median_rows(unfiltered_.data(), width_, height_, parameters_.median_size, begin, end, maps.disparity);
        follow_median(maps, begin * width_, end * width_);
      });
    });
  }

  [[nodiscard]] std::vector<ks_stage_time> stage_times() const override { return times_; }

 private:
  void transform(ConstImage image, size_t eye) {
    if (images_[eye].element_bytes() != image.element_bytes)
      images_[eye] = {width_, height_, image.element_bytes, parameters_.census_contrast > 0};
    const cpu::CensusWindow window{parameters_.census, parameters_.census_width, parameters_.census_height, parameters_.census_contrast};
    for_rows([&](size_t begin, size_t end) { images_[eye].copy_rows(image, begin, end); });
    for_rows([&](size_t begin, size_t end) { cpu::census_rows(images_[eye], window, begin, end, census_[eye]); });
  }

  /// The other maps tell of the disparity after the median.
  void follow_median(const MatchMaps& maps, size_t begin, size_t end) const {
    for (size_t i = begin; i < end && (maps.reason || maps.confidence); ++i) {
      const bool valid = maps.disparity[i] != parameters_.invalid_disparity();
      if (maps.confidence && !valid) maps.confidence[i] = 0;
      if (!maps.reason) continue;
      if (valid) maps.reason[i] = MatchReason::valid;
      if (!valid && maps.reason[i] == MatchReason::valid) maps.reason[i] = MatchReason::isolated;
    }
  }

  template <class F>
  void for_rows(F&& fn) {
    constexpr size_t rows = 32;
    workers_.parallel_for((height_ + rows - 1) / rows, [&](size_t i) { fn(i * rows, std::min((i + 1) * rows, height_)); });
  }

  template <class F>
  void timed(const char* name, F&& fn) {
    const auto start = std::chrono::steady_clock::now();
    fn();
    ks_stage_time time{};
    std::strncpy(time.name, name, sizeof time.name - 1);
    time.milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    times_.push_back(time);
  }

  size_t width_, height_;
  MatchParameters parameters_;
  ks::ThreadPool& workers_;
  cpu::PaddedImage images_[2];
  cpu::CensusPlanes census_[2];
  cpu::PenaltyMaps penalties_;
  std::unique_ptr<cpu::Aggregation> aggregation_;
  cpu::Buffer<float> unfiltered_;
  std::vector<ks_stage_time> times_;
};

}  // namespace

std::unique_ptr<Matcher> make_cpu_matcher(uint32_t width, uint32_t height, const MatchParameters& parameters, ks::ThreadPool& workers) {
  return std::make_unique<CpuMatcher>(width, height, parameters, workers);
}

}  // namespace simsense
