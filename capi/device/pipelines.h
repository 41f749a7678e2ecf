// SPDX-License-Identifier: Apache-2.0
// A device's compute pipelines: each is built once, on a thread of its own, for all objects of the device. A driver's compiler takes
// seconds and cannot be stopped, but a cancelled caller need not wait: the thread goes on, and the next use finds the result.
#pragma once

#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <tuple>
#include <vector>

#include "device/compute.h"

namespace ks {

/// Lives in its device. Thread rule: internally synchronised.
class Pipelines {
 public:
  explicit Pipelines(Device& device) : device_(device) {}

  /// Starts the build, so that it ends sooner and several run side by side. get() throws its errors.
  void begin(std::span<const uint32_t> spirv, uint32_t push_constant_bytes, std::span<const uint32_t> specialisation);
  /// Returns the pipeline, and waits for it if necessary; it lives as long as the device. Throws KS_ERROR_CANCELLED during the wait, and
  /// the build's errors. The SPIR-V must live as long as the library.
  const ComputePipeline& get(std::span<const uint32_t> spirv, uint32_t push_constant_bytes, std::span<const uint32_t> specialisation);

 private:
  using Pipeline = std::unique_ptr<const ComputePipeline>;
  using Built = std::shared_future<Pipeline>;
  Built started(std::span<const uint32_t> spirv, uint32_t push_constant_bytes, std::span<const uint32_t> specialisation);

  Device& device_;
  std::mutex mutex_;
  std::map<std::tuple<const uint32_t*, uint32_t, std::vector<uint32_t>>, Built> built_;  // by the arguments of get()
};

}  // namespace ks
