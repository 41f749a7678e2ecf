// SPDX-License-Identifier: Apache-2.0
// This file runs the stages in Vulkan compute.
#include <array>

#include "device/pipelines.h"
#include "pathtrace/stages.h"
#include "spirv/accumulate.h"
#include "spirv/aov_infrared.h"
#include "spirv/aov_visible.h"
#include "spirv/follow_infrared.h"
#include "spirv/follow_visible.h"
#include "spirv/gather_infrared.h"
#include "spirv/gather_visible.h"
#include "spirv/generate.h"
#include "spirv/resolve.h"
#include "spirv/send_infrared.h"
#include "spirv/send_visible.h"
#include "spirv/shade_infrared.h"
#include "spirv/shade_visible.h"
#include "spirv/splat_table.h"
#include "spirv/transmit_infrared.h"
#include "spirv/transmit_visible.h"
#include "spirv/visibility.h"

namespace kuafu {
namespace {

using Spirv = std::span<const uint32_t>;

/// The texts of a stage that is compiled for each band.
struct OfBands {
  Spirv visible, infrared;
  [[nodiscard]] Spirv of(const WaveSize& size) const { return size.channels == 1 ? infrared : visible; }
};
const OfBands shade_spirv{shade_visible_spirv, shade_infrared_spirv}, transmit_spirv{transmit_visible_spirv, transmit_infrared_spirv},
    gather_spirv{gather_visible_spirv, gather_infrared_spirv}, send_spirv{send_visible_spirv, send_infrared_spirv},
    follow_spirv{follow_visible_spirv, follow_infrared_spirv};

constexpr uint32_t group_size = 128;  // measured best on an NVIDIA H200 and on lavapipe: one atomic of a queue per group

class DeviceStages final : public Stages {
 public:
  DeviceStages(std::shared_ptr<ks::Device> device, const Tracer& tracer) : device_(std::move(device)), tracer_(tracer) {}

  void prepare(const WaveSize& size, bool camera) override {
    const auto begin = [&](Spirv spirv, size_t push_bytes, uint32_t features = 0) {
      device_->pipelines().begin(spirv, uint32_t(push_bytes), specialisation(features));
    };
    begin(shade_spirv.of(size), sizeof(ShadePush), size.features);
    begin(generate_spirv, sizeof(GeneratePush), camera ? feature_camera : 0);
    begin(resolve_spirv, sizeof(ResolvePush));
    begin(accumulate_spirv, sizeof(AccumulatePush));
  }

  void generate(ks::Commands& commands, const GeneratePush& push, const WaveBuffers& buffers) override {
    commands.begin_stage("generate");
    commands.fill(buffers.counters(), 0, buffers.counter_bytes(), 0);
    const bool camera = (push.flags & generate_camera) != 0;
    dispatch(commands, generate_spirv, push, push.range.pixel_count * push.range.sample_count, camera ? feature_camera : 0);
  }

  void shade(ks::Commands& commands, const ShadePush& push, const WaveBuffers& buffers) override {
    commands.begin_stage("shade");
    commands.dispatch_indirect(built<ShadePush>(shade_spirv.of(buffers.size()), buffers.size().features), push, buffers.counters(),
                               shade_arguments(push.bounce));
  }

  void transmit(ks::Commands& commands, const TransmitPush& push, const WaveBuffers& buffers) override {
    commands.begin_stage("transmit");
    commands.dispatch_indirect(built<TransmitPush>(transmit_spirv.of(buffers.size()), buffers.size().features), push, buffers.counters(),
                               (uint64_t(push.block_in) * counter_words + counter_transmit_arguments) * 4);
  }

  void send(ks::Commands& commands, const BeamPush& push, const WaveBuffers& buffers) override {
    commands.begin_stage("follow beams");
    commands.fill(buffers.counters(), 0, buffers.counter_bytes(), 0);
    commands.dispatch(built<BeamPush>(send_spirv.of(buffers.size()), buffers.size().features), push, groups_of(push.count));
  }

  void follow(ks::Commands& commands, const BeamPush& push, const WaveBuffers& buffers) override {
    commands.begin_stage("follow beams");
    commands.dispatch_indirect(built<BeamPush>(follow_spirv.of(buffers.size()), buffers.size().features), push, buffers.counters(),
                               shade_arguments(push.block));
  }

  void tabulate(ks::Commands& commands, const Splats& splats) override {
    commands.begin_stage("follow beams");
    commands.fill(splats.words(), 0, splats.cleared_bytes(), 0);
    for (uint32_t step = 0; step < splat_steps; ++step)
      dispatch(commands, splat_table_spirv, SplatTablePush{.table = splats.table(), .step = step}, splats.step_size(step));
  }

  void gather(ks::Commands& commands, const ShadePush& push, const WaveBuffers& buffers) override {
    commands.begin_stage("gather");
    commands.dispatch_indirect(built<ShadePush>(gather_spirv.of(buffers.size()), buffers.size().features), push, buffers.counters(),
                               shade_arguments(push.bounce));
  }

  void resolve(ks::Commands& commands, const ResolvePush& push, const WaveBuffers& buffers) override {
    commands.begin_stage("resolve");
    commands.dispatch_indirect(built<ResolvePush>(resolve_spirv), push, buffers.counters(), shade_arguments(push.bounce));
  }

  void accumulate(ks::Commands& commands, const AccumulatePush& push) override {
    commands.begin_stage("accumulate");
    dispatch(commands, accumulate_spirv, push, push.range.pixel_count);
  }

  void aov(ks::Commands& commands, const AovPush& push) override {
    commands.begin_stage("aov");
    const bool infrared = (push.flags & aov_infrared) != 0, camera = (push.flags & aov_camera) != 0;
    dispatch(commands, infrared ? Spirv(aov_infrared_spirv) : aov_visible_spirv, push, push.range.pixel_count,
             feature_lookups | (camera ? feature_camera | feature_motion : 0));
  }

  void visibility(ks::Commands& commands, const AovPush& push) override {
    commands.begin_stage("aov");
    dispatch(commands, visibility_spirv, push, push.range.pixel_count);
  }

 private:
  static uint32_t groups_of(uint32_t invocations) { return (invocations + group_size - 1) / group_size; }
  static uint64_t shade_arguments(uint32_t bounce) { return (uint64_t(bounce) * counter_words + counter_shade_arguments) * 4; }

  /// By constant_id (lib/invocation.glsl); 4 is the denoiser's.
  [[nodiscard]] std::array<uint32_t, 6> specialisation(uint32_t features) const {
    return {group_size, tracer_.queue_layout(), tracer_.trace_group_size(), features, 0, tracer_.spread_groups()};
  }

  template <class Push>
  const ks::ComputePipeline& built(Spirv spirv, uint32_t features = 0) {
    return device_->pipelines().get(spirv, uint32_t(sizeof(Push)), specialisation(features));
  }

  template <class Push>
  void dispatch(ks::Commands& commands, Spirv spirv, const Push& push, uint32_t invocations, uint32_t features = 0) {
    commands.dispatch(built<Push>(spirv, features), push, groups_of(invocations));
  }

  std::shared_ptr<ks::Device> device_;
  const Tracer& tracer_;
};

}  // namespace

std::unique_ptr<Stages> make_device_stages(std::shared_ptr<ks::Device> device, const Tracer& tracer) {
  return std::make_unique<DeviceStages>(std::move(device), tracer);
}

}  // namespace kuafu
