// SPDX-License-Identifier: Apache-2.0
// The stages work between the tracer's calls. One text (shaders/lib, shaders/stage) runs in two places: in Vulkan compute, or compiled as
// C++ on the device's worker threads. CPU devices take the second, where the rays are on the host already and a native compiler makes
// faster code than the driver's. Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "accel/tracer.h"
#include "pathtrace/splats.h"
#include "pathtrace/wave_memory.h"
#include "shared/wave.h"

namespace kuafu {

class Stages {
 public:
  virtual ~Stages() = default;
  /// Lets a driver compile in parallel what waves of this size need. camera: whether any view is not a resting pinhole.
  virtual void prepare(const WaveSize&, [[maybe_unused]] bool camera) {}
  /// Clears the counters and fills the first queue.
  virtual void generate(ks::Commands& commands, const GeneratePush& push, const WaveBuffers& buffers) = 0;
  virtual void shade(ks::Commands& commands, const ShadePush& push, const WaveBuffers& buffers) = 0;
  /// Takes the shadow rays past one surface of glass.
  virtual void transmit(ks::Commands& commands, const TransmitPush& push, const WaveBuffers& buffers) = 0;
  /// Adds the light that bodies of glass have bent to the points that paths reached; call before `shade`.
  virtual void gather(ks::Commands& commands, const ShadePush& push, const WaveBuffers& buffers) = 0;
  /// Clears the counters and fills the first queue with beams of light.
  virtual void send(ks::Commands& commands, const BeamPush& push, const WaveBuffers& buffers) = 0;
  /// Follows beams through one surface, or lets them land.
  virtual void follow(ks::Commands& commands, const BeamPush& push, const WaveBuffers& buffers) = 0;
  /// Makes the table of all beams' splats.
  virtual void tabulate(ks::Commands& commands, const Splats& splats) = 0;
  virtual void resolve(ks::Commands& commands, const ResolvePush& push, const WaveBuffers& buffers) = 0;
  virtual void accumulate(ks::Commands& commands, const AccumulatePush& push) = 0;
  virtual void aov(ks::Commands& commands, const AovPush& push) = 0;
  /// Writes the results of the shadow rays of `aov`; call after they were traced.
  virtual void visibility(ks::Commands& commands, const AovPush& push) = 0;
};

std::unique_ptr<Stages> make_device_stages(std::shared_ptr<ks::Device> device, const Tracer& tracer);
/// Makes the host's stages, for queues of packets in host-visible memory and addresses that are host pointers.
std::unique_ptr<Stages> make_host_stages(std::shared_ptr<ks::Device> device);

}  // namespace kuafu
