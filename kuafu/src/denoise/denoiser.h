// SPDX-License-Identifier: Apache-2.0
// The denoiser takes the noise out of all light but the projectors' direct light, which carries the dots and has none. An a-trous filter
// works on light over albedo, guided by surfaces and by the noise that the samples themselves show; then rays over each pixel's square put
// albedo and edges back (shaders/stage/denoise.glsl, remodulate.glsl). Light may be accumulated over launches of the same views. Thread
// rule: externally synchronised.
#pragma once

#include "denoise/oidn.h"
#include "frame/device_array.h"
#include "frame/frame.h"
#include "frame/image_step.h"
#include "frame/launch.h"
#include "shared/denoise_record.h"

namespace kuafu {

/// The denoiser keeps a history of one launch for the next: its light, its guides, and where cameras and instances stood.
class History {
 public:
  explicit History(Memory memory) : memory_(std::move(memory)) {}

  /// Call it before a launch that accumulates `planes` of light. It takes `guides`, those of the last launch, and gives others for this
  /// one.
  void begin(const Launch& launch, const Scene& scene, size_t planes, std::shared_ptr<ks::Buffer>& guides, DenoiseImages& images);
  /// Says what the step `guide` writes for the step `accumulate`.
  void describe(GuidePush& push) const;
  /// Call it when the launch has its light, so that the next one may build on it.
  void end() { views_ = std::move(next_views_); }
  void forget() { views_.clear(); }

 private:
  void write_views();
  void write_poses(const Scene& scene);

  struct Pose {
    uint32_t instance = none;
    glm::vec4 rows[3];  // of local_to_world
  };

  Memory memory_;
  // [0] belongs to the last launch, [1] to this one.
  std::shared_ptr<ks::Buffer> light_[2], pixels_[2], places_[2], guides_;
  MappedTable<HistoryView> last_views_;
  MappedTable<glm::vec4> last_poses_;
  std::vector<Pose> poses_;            // by slot, in the last launch that began
  std::vector<View> views_;            // the views of [0]; empty: there is no last launch
  std::vector<View> next_views_;       // the views of this launch, until end()
  std::shared_ptr<const void> scene_;  // identity of the last launch's; another scene has instance ids of its own
  uint32_t width_ = 0, height_ = 0;
  size_t planes_ = 0;
  bool has_last_ = false;
};

/// The images that the frame must hold for the launch's denoiser, as bits.
uint32_t held_for_denoiser(const Launch& launch);
/// The images that are filtered, in the order of DenoiseImages.
std::vector<uint32_t> denoised_kinds(const Launch& launch);

class Denoiser {
 public:
  /// oidn_library is as Oidn takes it; the library is opened when a launch asks for it.
  Denoiser(Memory memory, uint32_t queue_layout, std::string oidn_library);
  /// Call it before the first wave of a launch that denoises.
  void fit(const Launch& launch, const Scene& scene, const Frame& frame);
  /// Call it after rays through pixel centres were traced.
  void guide(ks::Commands& commands, const WaveRays& centre);
  /// Call it after each wave of paths, with their state.
  void moments(ks::Commands& commands, uint64_t state, const WaveRange& range, uint32_t groups, bool first_pass);
  /// Call it after the last wave; `samples` were in all waves since first_pass.
  void filter(ks::Commands& commands, uint32_t samples);
  /// Filters finished images by Open Image Denoise instead; nothing is remodulated then.
  void filter_by_oidn(const Launch& launch, const Frame& frame);
  /// Whether a lens or an exposure blurs the launch. Then call blend before the filter, and trace no rays after it.
  [[nodiscard]] bool blurs() const { return blurs_; }
  /// Call it after square_rays rays over each pixel's square were traced, before the filter.
  void blend(ks::Commands& commands, const WaveRays& square);
  /// Multiplies the filtered light by albedo, but for the pixels of squares().
  void multiply(ks::Commands& commands);
  /// The number of pixels that ask for rays over their squares, where the host can tell (it flushes `commands`); else the most that may
  /// ask.
  [[nodiscard]] uint32_t square_count(ks::Commands& commands) const;
  /// Address of that number and the pixels' indices behind it; 0 if all pixels ask.
  [[nodiscard]] uint64_t squares() const { return blurs_ ? 0 : memory_.address(*squares_); }
  /// Call it after square_rays rays were traced for each pixel in the wave's part of squares().
  void remodulate(ks::Commands& commands, const WaveRays& square);
  /// Call it last: it sums ambient and radiance from their parts.
  void sum(ks::Commands& commands);

 private:
  void step(ks::Commands& commands, uint32_t step, uint32_t spacing = 0);

  Memory memory_;
  ImageStep<GuidePush> guide_;
  ImageStep<MomentsPush> moments_;
  ImageStep<DenoisePush> denoise_;
  ImageStep<RemodulatePush> remodulate_;
  MappedTable<DenoiseImages> images_;
  History history_;
  std::unique_ptr<Oidn> oidn_;
  std::string oidn_library_;
  std::shared_ptr<ks::Buffer> guides_, sums_, light_[2], pixels_[2], smooth_, squares_;
  void over_square(ks::Commands& commands, const WaveRays& square, uint32_t count, bool blends);
  void list_squares() const;
  bool accumulates_ = false, blurs_ = false;
  DenoisePush push_{};
  uint32_t channels_ = 1, planes_ = 1;
  bool infrared_ = false;
};

namespace host {
// The denoiser's stages compiled as C++. Thread rule: any thread; ranges are independent.
void guide(const GuidePush& push, uint32_t first, uint32_t end);
void moments(const MomentsPush& push, uint32_t first, uint32_t end);
void denoise(const DenoisePush& push, uint32_t first, uint32_t end);
void remodulate(const RemodulatePush& push, uint32_t first, uint32_t end);
}  // namespace host

}  // namespace kuafu
