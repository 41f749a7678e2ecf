// SPDX-License-Identifier: Apache-2.0
// The denoiser keeps a history of one launch for the next: its light, its guides, and where cameras and instances stood. Thread rule:
// externally synchronised.
#pragma once

#include "frame/device_array.h"
#include "frame/launch.h"
#include "shared/denoise_record.h"

namespace kuafu {

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

}  // namespace kuafu
