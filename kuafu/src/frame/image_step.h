// SPDX-License-Identifier: Apache-2.0
// A step on whole images runs one text (shaders/stage) as a Vulkan pipeline, or as C++ on the worker threads. Push holds the step's
// arguments; its `count` is the number of invocations. Thread rule: externally synchronised.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <span>

#include "device/pipelines.h"
#include "device/thread_pool.h"
#include "frame/device_array.h"
#include "shared/wave.h"

namespace kuafu {

/// A wave's rays and their hits, for steps that read them: addresses of the queue and of the tables that hits refer to.
struct WaveRays {
  uint64_t rays = 0, scene = 0, views = 0;
  WaveRange range{};
};

template <class Push>
class ImageStep {
 public:
  using HostKernel = void(const Push& push, uint32_t first, uint32_t end);
  /// queue_layout: the tracer's, for a step that reads rays.
  ImageStep(Memory memory, std::span<const uint32_t> spirv, HostKernel* kernel, uint32_t queue_layout = queue_layout_planes)
      : memory_(std::move(memory)),
        spirv_(spirv),
        kernel_(kernel),
        specialisation_{group_size, queue_layout, 1, feature_motion | feature_lookups, 0} {}

  /// Records or runs the step. `constant` sets the shader's specialisation constant 4, if it has one, such as a substep: each substep then
  /// has its own registers.
  void run(ks::Commands& commands, const char* stage, const Push& push, uint32_t constant = 0) {
    if (memory_.on_host) return run_on_host(commands, stage, push);
    commands.begin_stage(stage);
    commands.dispatch_line(pipeline(constant), push, (push.count + group_size - 1) / group_size);
  }

 private:
  static constexpr uint32_t group_size = 128, chunk_size = 512;

  const ks::ComputePipeline& pipeline(uint32_t constant) {
    specialisation_.back() = constant;
    return memory_.device->pipelines().get(spirv_, uint32_t(sizeof(Push)), specialisation_);
  }

  void run_on_host(ks::Commands& commands, const char* stage, const Push& push) const {
    const auto start = std::chrono::steady_clock::now();
    memory_.device->workers().parallel_for((size_t(push.count) + chunk_size - 1) / chunk_size, [&](size_t chunk) {
      const auto first = uint32_t(chunk) * chunk_size;
      kernel_(push, first, std::min(push.count, first + chunk_size));
    });
    commands.add_host_time(stage, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }

  Memory memory_;
  std::span<const uint32_t> spirv_;
  HostKernel* kernel_;
  std::array<uint32_t, 5> specialisation_;  // of lib/invocation.glsl; surfaces that rays met may move and have all textures
};

}  // namespace kuafu
