// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include "device/interrupt.h"

namespace kuafu {

void hold_images(Launch& launch) {
  launch.held = launch.relative_error > 0.0 ? 1u << output_variance | 1u << output_radiance : 0;
  if (launch.outputs[output_projector].buffer) launch.held |= projector_parts;
  if (launch.outputs[output_srgb].buffer) launch.held |= 1u << output_radiance;
  launch.held |= held_for_denoiser(launch) | held_for_optics(launch);
}

Renderer::Renderer(const std::shared_ptr<ks::Device>& device, TracerKind tracer, std::string oidn_library)
    : parts_(device, tracer, std::move(oidn_library)) {}

void Renderer::render(const Scene& scene, const Launch& launch) {
  // The recorder is kept from call to call. An error may leave it in the middle of its work, so the call after a failed one makes another.
  std::unique_ptr<ks::Commands> commands = commands_ ? std::move(commands_) : std::make_unique<ks::Commands>(device());
  parts_.paths.collect_times(*commands);  // those of a failed render
  commands->reset_stage_times();
  ks::Interrupt interrupt(launch.cancelled);
  if (device()->workers().is_hosts()) interrupt.start_no_thread();
  launch.wait.wait_on_host();
  RenderRun run(parts_, launch, *commands);
  try {
    run.prepare(scene);
    run.render();
  } catch (...) {
    parts_.accumulation.clear();  // some pixels have more samples than others
    throw;
  }
  stage_times_ = commands->stage_times();
  summary_ = run.summary();
  if (!launch.accumulate) parts_.accumulation.clear();
  commands_ = std::move(commands);
}

void Renderer::light(const Scene& scene, const GbufferLaunch& gbuffers) {
  std::unique_ptr<ks::Commands> commands = commands_ ? std::move(commands_) : std::make_unique<ks::Commands>(device());
  commands->reset_stage_times();
  if (!gbuffers_) gbuffers_ = std::make_unique<GbufferLight>(parts_.paths.memory());
  parts_.frame.fit(gbuffers.launch);
  gbuffers_->run(*commands, scene, gbuffers, parts_.frame);
  parts_.optics.run(*commands, gbuffers.launch, parts_.frame);
  parts_.frame.deliver(*commands, gbuffers.launch);
  commands->flush();
  stage_times_ = commands->stage_times();
  commands_ = std::move(commands);
  gbuffers_->check(gbuffers);
}

}  // namespace kuafu
