// SPDX-License-Identifier: Apache-2.0
// The scalar reference of the whole matcher: the stages one after another on full volumes, slow and plain.
#include "match/matcher.h"

#include <algorithm>

#include "simsense/reference/match.h"

namespace simsense {
namespace {

class ReferenceMatcher final : public Matcher {
 public:
  ReferenceMatcher(uint32_t width, uint32_t height, const MatchParameters& parameters)
      : width_(width), height_(height), parameters_(parameters) {}

  void match(ConstImage left, ConstImage right, const MatchMaps& maps) override {
    using namespace reference;
    const MatchParameters& p = parameters_;
    const auto cost = [&] {
      const auto left_census = census(left, width_, height_, p);
      const auto right_census = census(right, width_, height_, p);
      return block_sum(hamming_cost(left_census, right_census, p.max_disparity, p.min_disparity), p.block_width, p.block_height);
    }();
    const uint32_t area = p.block_area();  // the penalties are given per pixel of the block
    const auto aggregated = aggregate(cost, {p.p1, p.p2, p.p2_full_gradient_dn, left}, area, p.path_count);
    auto result = left_winner(aggregated, p.uniqueness_ratio, p.subpixel, area > 1 ? &cost : nullptr);
    Grid<MatchReason> reason(width_, height_, MatchReason::valid);
    std::transform(result.data.begin(), result.data.end(), reason.data.begin(),
                   [](float d) { return d < 0 ? MatchReason::not_unique : MatchReason::valid; });
    if (p.lr_max_diff >= 0)
      result = left_right_check(result, right_winner(aggregated, p.min_disparity), p.lr_max_diff, p.min_disparity, &reason);
    result = median(result, p.median_size);
    for (size_t i = 0; i < result.data.size(); ++i) {
      const bool valid = result.data[i] >= 0;
      if (valid) reason.data[i] = MatchReason::valid;
      if (!valid && reason.data[i] == MatchReason::valid) reason.data[i] = MatchReason::isolated;
      result.data[i] = valid ? result.data[i] + static_cast<float>(p.min_disparity) : p.invalid_disparity();
    }
    if (p.refines()) result = refine(left, right, result, p);
    if (p.detects()) {
      const auto stays = detects(left, right, result, p, noise_);
      for (size_t i = 0; i < result.data.size(); ++i)
        if (!stays.data[i]) result.data[i] = p.invalid_disparity(), reason.data[i] = MatchReason::low_texture;
    }
    std::copy(result.data.begin(), result.data.end(), maps.disparity);
    if (maps.reason) std::copy(reason.data.begin(), reason.data.end(), maps.reason);
    if (maps.confidence) {
      const auto sure = confidence(aggregated);
      for (size_t i = 0; i < sure.data.size(); ++i) maps.confidence[i] = result.data[i] != p.invalid_disparity() ? sure.data[i] : 0;
    }
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
