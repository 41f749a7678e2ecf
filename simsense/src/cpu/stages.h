// SPDX-License-Identifier: Apache-2.0
// The stages of one pair on the host. A stage writes straight into the caller's memory where that is packed; scratch memory is kept between
// calls. Thread rule: externally synchronised.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "cpu/checks/checks.h"
#include "cpu/frame.h"
#include "cpu/matcher.h"
#include "cpu/registration/registration.h"
#include "match/host_clock.h"
#include "stages/stages.h"

namespace simsense {

class CpuStages final : public Stages {
 public:
  /// rig must outlive this.
  CpuStages(const PreparedRig& rig, ks::ThreadPool& workers);

  /// Runs all stages of one pair. progress: called with the finished share of the pair, 0..1; may throw.
  void run(const StageSettings& settings, const HostFrame& frame, uint32_t pair, const std::function<void(float)>& progress);
  void reset_times() { clock_.reset(); }
  [[nodiscard]] const std::vector<ks_stage_time>& times() const { return clock_.times(); }

  void signal() override;
  void rectify() override;
  MatchStages& matcher() override;
  void place_region() override;
  void drop_padding() override;
  void drop_low_texture() override;
  void filter_speckles() override;
  void drop_edges() override;
  void fill_holes() override;
  void depth() override;
  void registration() override;
  void points() override;
  void reason() override;
  void store_maps() override;
  [[nodiscard]] bool makes_points_apart() const override { return true; }
  void measure(const char* name, const std::function<void()>& run) override { clock_.measure(name, run); }

 private:
  /// The arguments of run().
  struct Call {
    const StageSettings& settings;
    const HostFrame& frame;
    uint32_t pair;
    const std::function<void(float)>& progress;
  };
  ConstImage measure_side(uint32_t side);
  ConstImage measure_wide(uint32_t side);
  ConstImage widened(ConstImage image, uint32_t side);
  ConstImage rectify_side(uint32_t side);
  void open_maps();
  [[nodiscard]] MatchMaps region_maps();

  const PreparedRig& rig_;
  ks::ThreadPool& workers_;
  uint32_t width_, height_;
  std::optional<Call> call_;  // while run() runs
  ConstImage images_[2];      // as the last stage has left them
  MatchMaps maps_ = nullptr;  // of the pair, width_ x height_
  const float* points_depth_ = nullptr;

  std::optional<CpuMatcher> matcher_;
  MatchParameters matcher_parameters_;
  Region matcher_region_;
  TextureCheck texture_check_;
  SpeckleFilter speckle_filter_;
  EdgeCheck edge_check_;
  std::optional<Registration> registration_;
  HostClock clock_;
  std::vector<uint8_t> counts_[2], rectified_[2], reason_, region_reason_;
  std::vector<uint16_t> wide_counts_[2], wide_rectified_[2];
  std::vector<float> disparity_, confidence_, depth_, depth_rgb_, region_disparity_, region_confidence_;
};

}  // namespace simsense
