// SPDX-License-Identifier: Apache-2.0
// The matcher's stages on the host's vectors, over a device's worker threads. Costs are made where a path needs them, and one pass over the
// image (cpu/sgm) follows the last paths, finds winners and holds them against the right image's: cost, sgm, winner and the left-right
// check share it. Thread rule: externally synchronised.
#pragma once

#include <functional>
#include <memory>

#include "cpu/census/census.h"
#include "cpu/detection/detection.h"
#include "cpu/refine/refine.h"
#include "cpu/sgm/penalty_maps.h"
#include "cpu/sgm/sgm.h"
#include "match/host_clock.h"
#include "match/matcher.h"

namespace simsense {

class CpuMatcher final : public Matcher, public MatchStages {
 public:
  CpuMatcher(uint32_t width, uint32_t height, const MatchParameters& parameters, ks::ThreadPool& workers);

  void match(ConstImage left, ConstImage right, const MatchMaps& maps) override;
  [[nodiscard]] std::vector<ks_stage_time> stage_times() const override { return clock_.times(); }

  /// Sets the images and maps of the following stages.
  void begin(ConstImage left, ConstImage right, const MatchMaps& maps);
  void census() override;
  void cost() override {}
  /// Follows the paths up and down the image and leaves checkpoints.
  void sgm() override;
  /// Follows the paths along rows, and those down from the checkpoints; finds winners and checks them against the right image.
  void winner() override;
  /// Filters by the median, and adapts the other maps to it.
  void checks() override;
  void refine() override;
  void detection() override;
  [[nodiscard]] bool stores_costs() const override { return false; }
  [[nodiscard]] bool refines() const override { return parameters_.refines(); }
  [[nodiscard]] bool detects() const override { return parameters_.detects(); }

 private:
  void transform(size_t side);
  void follow_median(size_t begin, size_t end) const;
  void keep_disparities();
  void for_rows(const std::function<void(size_t begin, size_t end)>& run);

  size_t width_, height_;
  MatchParameters parameters_;
  ks::ThreadPool& workers_;
  cpu::PaddedImage padded_[2];
  cpu::CensusPlanes census_[2];
  cpu::PenaltyMaps penalties_;
  std::unique_ptr<cpu::Aggregation> aggregation_;
  cpu::Buffer<float> unfiltered_;  // then what is refined or held against noise
  cpu::Refinement refinement_;
  cpu::DetectionCheck detection_;
  HostClock clock_;
  ConstImage images_[2];
  MatchMaps maps_ = nullptr;
};

}  // namespace simsense
