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

  /// Before a launch of `planes` of light that is accumulated. Takes `guides`, those of the last launch, and gives others for this one.
  void begin(const Launch& launch, const Scene& scene, size_t planes, std::shared_ptr<ks::Buffer>& guides, DenoiseImages& images);
  /// What `guide` writes for `accumulate`.
  void describe(GuidePush& push) const;
  /// The launch has got as far as its light: the next one may follow it.
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
  // [0]: of the last launch, [1]: of this one.
  std::shared_ptr<ks::Buffer> light_[2], pixels_[2], places_[2], guides_;
  MappedTable<HistoryView> last_views_;
  MappedTable<glm::vec4> last_poses_;
  std::vector<Pose> poses_;       // by slot, of the last launch that began
  std::vector<View> views_;       // that [0] is of; empty: there is none
  std::vector<View> next_views_;  // of this launch, until it has got that far
  const Scene* scene_ = nullptr;  // of the last launch: instances of another one have ids of their own
  uint32_t width_ = 0, height_ = 0;
  size_t planes_ = 0;
  bool has_last_ = false;
};

}  // namespace kuafu
