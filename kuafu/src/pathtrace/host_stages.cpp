// SPDX-License-Identifier: Apache-2.0
// This file runs the stages on the device's worker threads, in chunks of rays or pixels.
#include <algorithm>
#include <chrono>
#include <cstring>

#include "device/thread_pool.h"
#include "pathtrace/host_kernels.h"
#include "pathtrace/stages.h"

namespace kuafu {
namespace {

constexpr uint32_t chunk_rays = 1024;  // a chunk hides its hand-over and still balances the threads; a multiple of the packets of 8

class HostStages final : public Stages {
 public:
  explicit HostStages(std::shared_ptr<ks::Device> device) : device_(std::move(device)) {}

  void generate(ks::Commands& commands, const GeneratePush& push, const WaveBuffers& buffers) override {
    std::fill_n(push.counters.at, buffers.counter_bytes() / 4, 0u);
    const uint32_t paths = push.range.pixel_count * push.range.sample_count;
    push.counters.at[counter_ray_count] = paths;
    run(commands, "generate", paths, chunk_rays, [&](uint32_t first, uint32_t end) { host::generate(push, first, end); });
  }

  void shade(ks::Commands& commands, const ShadePush& push, const WaveBuffers& buffers) override {
    uint32_t* counters = push.counters.at + push.bounce * counter_words;
    host::QueueEnds ends;
    host::ShadeKernel* const kernel = kernels(buffers).shade;
    run(commands, "shade", counters[counter_ray_count], chunk_rays, [&](uint32_t first, uint32_t end) { kernel(push, first, end, ends); });
    counters[counter_shadow_count] = ends.shadow;
    counters[counter_words + counter_ray_count] = ends.next;
  }

  void transmit(ks::Commands& commands, const TransmitPush& push, const WaveBuffers& buffers) override {
    host::QueueEnds ends;
    host::TransmitKernel* const kernel = kernels(buffers).transmit;
    run(commands, "transmit", push.counters.at[push.block_in * counter_words + counter_shadow_count], chunk_rays,
        [&](uint32_t first, uint32_t end) { kernel(push, first, end, ends); });
    push.counters.at[push.block_out * counter_words + counter_shadow_count] = ends.shadow;
  }

  void send(ks::Commands& commands, const BeamPush& push, const WaveBuffers& buffers) override {
    std::fill_n(push.counters.at, buffers.counter_bytes() / 4, 0u);
    push.counters.at[counter_ray_count] = push.count;
    host::SendKernel* const kernel = kernels(buffers).send;
    run(commands, "follow beams", push.count, chunk_rays, [&](uint32_t first, uint32_t end) { kernel(push, first, end); });
  }

  void follow(ks::Commands& commands, const BeamPush& push, const WaveBuffers& buffers) override {
    uint32_t* counters = push.counters.at + push.block * counter_words;
    host::QueueEnds ends;
    host::FollowKernel* const kernel = kernels(buffers).follow;
    run(commands, "follow beams", counters[counter_ray_count], chunk_rays,
        [&](uint32_t first, uint32_t end) { kernel(push, first, end, ends); });
    counters[counter_words + counter_ray_count] = ends.next;
  }

  void tabulate(ks::Commands& commands, const Splats& splats) override {
    std::memset(splats.words().mapped(), 0, splats.cleared_bytes());
    for (uint32_t step = 0; step < splat_steps; ++step) {
      const SplatTablePush push{.table = splats.table(), .step = step};
      run(commands, "follow beams", splats.step_size(step), chunk_rays,
          [&](uint32_t first, uint32_t end) { host::splat_table(push, first, end); });
    }
  }

  void gather(ks::Commands& commands, const ShadePush& push, const WaveBuffers& buffers) override {
    host::GatherKernel* const kernel = kernels(buffers).gather;
    run(commands, "gather", push.counters.at[push.bounce * counter_words + counter_ray_count], chunk_rays,
        [&](uint32_t first, uint32_t end) { kernel(push, first, end); });
  }

  void resolve(ks::Commands& commands, const ResolvePush& push, const WaveBuffers&) override {
    const uint32_t rays = push.counters.at[push.bounce * counter_words + counter_ray_count];
    run(commands, "resolve", rays, chunk_rays, [&](uint32_t first, uint32_t end) { host::resolve(push, first, end); });
  }

  void accumulate(ks::Commands& commands, const AccumulatePush& push) override {
    const uint32_t chunk_pixels = std::max(1u, 4 * chunk_rays / push.range.sample_count);
    run(commands, "accumulate", push.range.pixel_count, chunk_pixels,
        [&](uint32_t first, uint32_t end) { host::accumulate(push, first, end); });
  }

  void aov(ks::Commands& commands, const AovPush& push) override {
    push.counters.at[counter_shadow_count] = (push.flags & aov_visibility) != 0 ? push.range.pixel_count : 0;
    const auto kernel = (push.flags & aov_infrared) != 0 ? host::aov_infrared : host::aov_visible;
    run(commands, "aov", push.range.pixel_count, chunk_rays, [&](uint32_t first, uint32_t end) { kernel(push, first, end); });
  }

  void visibility(ks::Commands& commands, const AovPush& push) override {
    run(commands, "aov", push.range.pixel_count, 4 * chunk_rays, [&](uint32_t first, uint32_t end) { host::visibility(push, first, end); });
  }

 private:
  static host::SurfaceKernels kernels(const WaveBuffers& buffers) {
    return host::surface_kernels(buffers.size().channels == 1, buffers.size().features);
  }

  template <class Kernel>
  void run(ks::Commands& commands, const char* name, uint32_t count, uint32_t chunk_size, const Kernel& kernel) {
    const auto start = std::chrono::steady_clock::now();
    device_->workers().parallel_for((size_t(count) + chunk_size - 1) / chunk_size, [&](size_t chunk) {
      const auto first = uint32_t(chunk) * chunk_size;
      kernel(first, std::min(count, first + chunk_size));
    });
    commands.add_host_time(name, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }

  std::shared_ptr<ks::Device> device_;
};

}  // namespace

std::unique_ptr<Stages> make_host_stages(std::shared_ptr<ks::Device> device) { return std::make_unique<HostStages>(std::move(device)); }

}  // namespace kuafu
