// SPDX-License-Identifier: Apache-2.0
// A compute pipeline that is built on a thread of its own, at its first use or before. A driver's compiler takes seconds and cannot be
// stopped, but a cancelled caller need not wait: the thread goes on, and the next use finds the result.
#pragma once

#include <future>
#include <memory>
#include <vector>

#include "device/compute.h"

namespace ks {

/// A compute pipeline that is built on another thread. Thread rule: externally synchronised.
class PipelineInBuild {
 public:
  /// Starts the build, so that it ends sooner and several run side by side. get() throws its errors.
  void begin(const std::shared_ptr<Device>& device, std::span<const uint32_t> spirv, uint32_t push_constant_bytes,
             std::span<const uint32_t> specialisation);
  /// Returns the pipeline, and waits for it if necessary. Throws KS_ERROR_CANCELLED during the wait, and the build's errors. Pass the same
  /// arguments each time; the SPIR-V must live as long as the library.
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
