// The scalar reference of the whole matcher: the stages one after another on full volumes, slow and plain.
#include "matcher.h"

#include <algorithm>

#include "reference/census.h"
#include "reference/cost.h"
#include "reference/disparity.h"
#include "reference/sgm.h"

namespace simsense {
namespace {

class ReferenceMatcher final : public Matcher {
 public:
  ReferenceMatcher(uint32_t width, uint32_t height, const MatchParameters& parameters)
      : width_(width), height_(height), parameters_(parameters) {}

  void match(ConstImage left, ConstImage right, float* disparity) override {
    using namespace reference;
    const MatchParameters& p = parameters_;
    const auto cost = [&] {
      const auto left_census = census(left, width_, height_, p.census_width, p.census_height);
      const auto right_census = census(right, width_, height_, p.census_width, p.census_height);
      return block_sum(hamming_cost(left_census, right_census, p.max_disparity), p.block_width, p.block_height);
    }();
    const uint32_t area = p.block_width * p.block_height;  // the penalties are given per pixel of the block
    const auto aggregated = aggregate(cost, p.p1 * area, p.p2 * area);
    auto result = left_winner(aggregated, p.uniqueness_ratio, p.subpixel, area > 1 ? &cost : nullptr);
    if (p.lr_max_diff >= 0) result = left_right_check(result, right_winner(aggregated), p.lr_max_diff);
    result = median(result, p.median_size);
    std::copy(result.data.begin(), result.data.end(), disparity);
  }

  [[nodiscard]] std::vector<ks_stage_time> stage_times() const override { return {}; }

 private:
  uint32_t width_, height_;
  MatchParameters parameters_;
};

}  // namespace

std::unique_ptr<Matcher> make_reference_matcher(uint32_t width, uint32_t height, const MatchParameters& parameters) {
  return std::make_unique<ReferenceMatcher>(width, height, parameters);
}

}  // namespace simsense
