// SPDX-License-Identifier: Apache-2.0
// Calls on the host: one pair of a batch after the other. Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "cpu/stages.h"
#include "stages/request.h"

namespace simsense {

class CpuCalls {
 public:
  /// rig must outlive this.
  CpuCalls(std::shared_ptr<ks::Device> device, const PreparedRig& rig);

  /// Runs a call and returns when its outputs are written.
  void compute(const ComputeRequest& request, const StageSettings& settings);
  /// The stage times of the last call.
  [[nodiscard]] const std::vector<ks_stage_time>& stage_times() const { return stages_.times(); }

 private:
  std::shared_ptr<ks::Device> device_;
  const PreparedRig& rig_;
  CpuStages stages_;
};

}  // namespace simsense
