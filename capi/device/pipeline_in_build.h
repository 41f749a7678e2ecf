// SPDX-License-Identifier: Apache-2.0
// A compute pipeline that is built on a thread of its own when it is first used, or before: a driver's compiler takes seconds and cannot be
// stopped, but a caller who wants to end need not wait for it. The thread then goes on, and the next use finds what it made.
#pragma once

#include <future>
#include <memory>
#include <vector>

#include "device/compute.h"

namespace ks {

/// Thread rule: externally synchronised.
class PipelineInBuild {
 public:
  /// Has the building begin, so that it is ready sooner, or several are built side by side. What goes wrong is get()'s to tell.
  void begin(const std::shared_ptr<Device>& device, std::span<const uint32_t> spirv, uint32_t push_constant_bytes,
             std::span<const uint32_t> specialisation);
  /// The pipeline, waiting for it where needed. Throws KS_ERROR_CANCELLED at an interruption point of the wait, and what building throws.
  /// The SPIR-V lives as long as the library; the same arguments are given each time.
  const ComputePipeline& get(const std::shared_ptr<Device>& device, std::span<const uint32_t> spirv, uint32_t push_constant_bytes,
                             std::span<const uint32_t> specialisation);

 private:
  using Task = std::packaged_task<std::unique_ptr<ComputePipeline>()>;
  Task task(const std::shared_ptr<Device>& device, std::span<const uint32_t> spirv, uint32_t push_constant_bytes,
            std::span<const uint32_t> specialisation);

  std::unique_ptr<ComputePipeline> pipeline_;
  std::future<std::unique_ptr<ComputePipeline>> building_;
};

}  // namespace ks
