// SPDX-License-Identifier: Apache-2.0
#include "device/pipelines.h"

#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdlib>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "device/interrupt.h"
#include "device/thread_pool.h"

namespace ks {
namespace {

/// The threads that build. They may outlive their callers but not the process: its end takes the driver's compiler apart.
class Builders {
 public:
  static Builders& get() {
    static auto* const builders = new Builders;  // never destroyed: the last builder still tells it
    return *builders;
  }

  template <class F>
  void start(F&& build) {
    std::atexit([] { get().wait(); });  // for each: an exit ends first what was made last, and drivers make statics as they compile
    const std::lock_guard lock(mutex_);
    std::thread([this, build = std::forward<F>(build)]() mutable {
      {
        auto own = std::move(build);  // ends before it is counted as done: it may be the last to hold the device
        own();
      }
      const std::lock_guard done(mutex_);
      --count_;
      idle_.notify_all();
    }).detach();
    ++count_;
  }

 private:
  Builders() = default;

  void wait() {
    if (getpid() != process_) return;  // a forked child has none of the threads
    std::unique_lock lock(mutex_);
    idle_.wait(lock, [&] { return count_ == 0; });
  }

  const pid_t process_ = getpid();
  std::mutex mutex_;
  std::condition_variable idle_;
  int count_ = 0;
};

/// Makes drivers compile now that would do it at the first run, as lavapipe does: a run of no groups.
void compile(const std::shared_ptr<Device>& device, const ComputePipeline& pipeline) {
  Commands commands(device);
  const VkCommandBuffer buffer = commands.handle();
  device->vk().vkCmdBindPipeline(buffer, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.handle());
  const std::vector<std::byte> push(pipeline.push_constant_bytes());  // what is declared must be set, also where nothing runs
  if (!push.empty())
    device->vk().vkCmdPushConstants(buffer, pipeline.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, static_cast<uint32_t>(push.size()),
                                    push.data());
  device->vk().vkCmdDispatch(buffer, 0, 0, 0);
  commands.flush();
}

/// Whether a build has ended with an error: the next use tries again.
bool has_failed(const std::shared_future<std::unique_ptr<const ComputePipeline>>& built) {
  if (built.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
  try {
    return built.get() == nullptr;
  } catch (...) {
    return true;
  }
}

/// Nothing may use a host's VkDevice after the library's was released, and a host that lends threads wants no others.
bool has_threads(const Device& device) { return !device.is_hosts() && !device.workers().is_hosts(); }

}  // namespace

Pipelines::Built Pipelines::started(std::span<const uint32_t> spirv, uint32_t push_constant_bytes,
                                    std::span<const uint32_t> specialisation) {
  std::vector<uint32_t> constants(specialisation.begin(), specialisation.end());
  std::unique_lock lock(mutex_);
  Built& kept = built_[{spirv.data(), push_constant_bytes, constants}];
  if (kept.valid() && !has_failed(kept)) return kept;
  const auto promise = std::make_shared<std::promise<Pipeline>>();
  Built built = kept = promise->get_future();
  lock.unlock();
  const auto build = [promise, device = device_.shared_from_this(), spirv, push_constant_bytes, constants = std::move(constants)] {
    try {
      auto pipeline = std::make_unique<const ComputePipeline>(*device, spirv, push_constant_bytes, constants);
      if (device->is_cpu()) compile(device, *pipeline);
      promise->set_value(std::move(pipeline));
    } catch (...) {
      promise->set_exception(std::current_exception());
    }
  };
  if (has_threads(device_)) try {
      Builders::get().start(build);
      return built;
    } catch (const std::system_error&) {  // no more threads: this one builds
    }
  build();
  return built;
}

void Pipelines::begin(std::span<const uint32_t> spirv, uint32_t push_constant_bytes, std::span<const uint32_t> specialisation) {
  if (has_threads(device_)) started(spirv, push_constant_bytes, specialisation);
}

const ComputePipeline& Pipelines::get(std::span<const uint32_t> spirv, uint32_t push_constant_bytes,
                                      std::span<const uint32_t> specialisation) {
  const Built built = started(spirv, push_constant_bytes, specialisation);
  while (built.wait_for(std::chrono::milliseconds(20)) != std::future_status::ready) interruption_point();
  return *built.get();
}

}  // namespace ks
