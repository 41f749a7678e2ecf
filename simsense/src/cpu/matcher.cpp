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
        images_{{width, height}, {width, height}},
        census_{{width, height, bit_count(p), cpu::left_reach(p)}, {width, height, bit_count(p), cpu::left_reach(p)}},
        aggregation_(cpu::make_aggregation(census_[0], census_[1], width, height, p, workers.size())),
        unfiltered_(size_t{width} * height) {}

  void match(ConstImage left, ConstImage right, float* disparity) override {
    times_.clear();
    const ConstImage pair[2] = {left, right};
    timed("census", [&] {
      for (size_t eye = 0; eye < 2; ++eye) {
        for_rows([&](size_t begin, size_t end) { images_[eye].copy_rows(pair[eye], begin, end); });
        for_rows([&](size_t begin, size_t end) {
          cpu::census_rows(images_[eye], parameters_.census_width, parameters_.census_height, begin, end, census_[eye]);
        });
      }
    });
    timed("vertical paths", [&] { workers_.parallel_for(aggregation_->sweep_count(), [&](size_t i) { aggregation_->sweep(i); }); });
    timed("aggregation and winner",
          [&] { workers_.parallel_for(aggregation_->band_count(), [&](size_t i) { aggregation_->match_band(i, unfiltered_.data()); }); });
    timed("median", [&] {
      for_rows([&](size_t begin, size_t end) {
        cpu::median_rows(unfiltered_.data(), width_, height_, parameters_.median_size, begin, end, disparity);
      });
    });
  }

  [[nodiscard]] std::vector<ks_stage_time> stage_times() const override { return times_; }

 private:
  static size_t bit_count(const MatchParameters& p) { return (size_t{p.census_width} * p.census_height - 1) / 2; }

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
  std::unique_ptr<cpu::Aggregation> aggregation_;
  cpu::Buffer<float> unfiltered_;
  std::vector<ks_stage_time> times_;
};

}  // namespace

std::unique_ptr<Matcher> make_cpu_matcher(uint32_t width, uint32_t height, const MatchParameters& parameters, ks::ThreadPool& workers) {
  return std::make_unique<CpuMatcher>(width, height, parameters, workers);
}

}  // namespace simsense
