// SPDX-License-Identifier: Apache-2.0
// Optics change the frame's images of light, view by view: the limit of fireflies, then vignetting, defocus by depth, point spread and
// veiling glare, in this order. All but the first, which changes radiance alone, are linear, so each light group gets them by itself and
// the groups still add up to the image. Thread rule: externally synchronised.
#pragma once

#include "frame/frame.h"
#include "frame/image_step.h"
#include "shared/optics_record.h"

namespace kuafu {

/// The images that the frame must hold for the launch's optics: light, depth for defocus, and the projector's direct light for the limit of
/// fireflies.
uint32_t held_for_optics(const Launch& launch);

class CameraOptics {
 public:
  explicit CameraOptics(Memory memory);
  /// Changes the light images that the caller asked for.
  void run(ks::Commands& commands, const Launch& launch, Frame& frame);

 private:
  void fit(const Launch& launch);
  void write_records(const Launch& launch);
  void limit_fireflies(ks::Commands& commands, OpticsPush push, const Launch& launch, const Frame& frame);
  void develop(ks::Commands& commands, OpticsPush push, uint32_t kind, Frame& frame);
  void spread(ks::Commands& commands, const OpticsPush& push);
  void step(ks::Commands& commands, OpticsPush push, uint32_t step, uint32_t count);

  Memory memory_;
  ImageStep<OpticsPush> step_;
  MappedTable<OpticsRecord> records_;
  MappedTable<float> kernels_;
  std::shared_ptr<ks::Buffer> scratch_, rows_;
  [[nodiscard]] bool takes(uint32_t step) const { return (steps_ >> step & 1u) != 0; }
  /// Whether the point spread runs in tiles: on a GPU, if the kernel leaves room in shared memory.
  [[nodiscard]] bool tiles() const { return takes(optics_psf_columns) && !memory_.on_host && psf_radius_ <= optics_most_tiled_radius_px; }
  uint32_t steps_ = 0;       // bit optics_*: some view needs this step
  uint32_t psf_radius_ = 0;  // the views' largest
};

namespace host {
/// Stage `optics` compiled as C++. Thread rule: any thread; ranges are independent.
void optics(const OpticsPush& push, uint32_t first, uint32_t end);
}  // namespace host

}  // namespace kuafu
