// SPDX-License-Identifier: Apache-2.0
// A compute pipeline that is built when it is first used, on a thread of its own: a driver's compiler takes seconds and cannot be stopped,
// but a caller who wants to end need not wait for it. The thread then goes on, and the next use finds what it made.
#pragma once

#include <future>
#include <memory>
#include <vector>

#include "device/compute.h"

namespace ks {

/// Thread rule: externally synchronised.
class PipelineInBuild {
 public:
  /// The pipeline, waiting for it where needed. Throws KS_ERROR_CANCELLED at an interruption point of the wait, and what building throws.
  /// The SPIR-V lives as long as the library; the same arguments are given each time.
  const ComputePipeline& get(const std::shared_ptr<Device>& device, std::span<const uint32_t> spirv, uint32_t push_constant_bytes,
                             std::span<const uint32_t> specialisation);

 private:
  std::unique_ptr<ComputePipeline> pipeline_;
  std::future<std::unique_ptr<ComputePipeline>> building_;
};

}  // namespace ks
