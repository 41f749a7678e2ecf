// SPDX-License-Identifier: Apache-2.0
// The renderer takes launches, one after the other: paths into the frame, then the steps on whole images (denoiser, optics), then the
// caller's formats.
// Thread rule: externally synchronised.
#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "gbuffer/gbuffer_light.h"
#include "render/render_run.h"

namespace kuafu {

/// Sets Launch::held for the steps after the paths: budget, denoiser and optics.
void hold_images(Launch& launch);

class Renderer {
 public:
  /// Throws KS_ERROR_UNSUPPORTED for Embree on a device whose memory the host does not share.
  /// oidn_library: path of Open Image Denoise; empty: wherever it is found.
  Renderer(const std::shared_ptr<ks::Device>& device, TracerKind tracer, std::string oidn_library = {});

  /// Blocks until the outputs are written. Throws KS_ERROR_CANCELLED when the launch's callback says so.
  void render(const Scene& scene, const Launch& launch);
  /// Works as render() for surfaces that another renderer saw.
  void light(const Scene& scene, const GbufferLaunch& gbuffers);
  /// Milliseconds per stage of the last render.
  [[nodiscard]] const std::vector<std::pair<std::string, double>>& stage_times() const { return stage_times_; }
  [[nodiscard]] const RenderSummary& summary() const { return summary_; }
  [[nodiscard]] const std::shared_ptr<ks::Device>& device() const { return parts_.paths.memory().device; }

 private:
  RenderParts parts_;
  std::unique_ptr<GbufferLight> gbuffers_;  // from the first of them on
  std::unique_ptr<ks::Commands> commands_;  // null during a render and after a failed one
  std::vector<std::pair<std::string, double>> stage_times_;
  RenderSummary summary_{};
};

}  // namespace kuafu
