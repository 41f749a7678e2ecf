// SPDX-License-Identifier: Apache-2.0
// Film optics change the frame's images of light, view by view: the limit of fireflies, then vignetting, defocus by depth, point spread and
// veiling glare, in this order. All but the first, which changes radiance alone, are linear, so each light group gets them by itself and
// the groups still add up to the image. Thread rule: externally synchronised.
#pragma once

#include "frame/frame.h"
#include "frame/image_step.h"
#include "shared/film_record.h"

namespace kuafu {

/// The images that the frame must hold for the launch's films: those of light, depth for defocus, and the projector's direct light for
/// the limit of fireflies.
uint32_t held_for_film(const Launch& launch);

class FilmOptics {
 public:
  explicit FilmOptics(Memory memory);
  /// Changes the light images that the caller asked for.
  void run(ks::Commands& commands, const Launch& launch, const Frame& frame);

 private:
  void fit(const Launch& launch);
  void write_records(const Launch& launch);
  void limit_fireflies(ks::Commands& commands, FilmPush push, const Launch& launch, const Frame& frame);
  void develop(ks::Commands& commands, FilmPush push);
  void step(ks::Commands& commands, FilmPush push, uint32_t step, uint32_t count);

  Memory memory_;
  ImageStep<FilmPush> step_;
  MappedTable<FilmRecord> records_;
  MappedTable<float> kernels_;
  std::shared_ptr<ks::Buffer> scratch_, rows_;
  [[nodiscard]] bool takes(uint32_t step) const { return (steps_ >> step & 1u) != 0; }
  uint32_t steps_ = 0;  // bit film_*: some view needs this step
};

namespace host {
/// Stage `film` compiled as C++. Thread rule: any thread; ranges are independent.
void film(const FilmPush& push, uint32_t first, uint32_t end);
}  // namespace host

}  // namespace kuafu
