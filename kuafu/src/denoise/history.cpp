// SPDX-License-Identifier: Apache-2.0
#include "denoise/denoiser.h"

#include <utility>

#include "scene/scene.h"

namespace kuafu {

void History::begin(const Launch& launch, const Scene& scene, size_t planes, std::shared_ptr<ks::Buffer>& guides, DenoiseImages& images) {
  if (std::exchange(scene_, scene.identity()) != scene.identity() || views_.size() != launch.views.size() || width_ != launch.width ||
      height_ != launch.height || planes_ != planes)
    forget();
  std::swap(guides_, guides);
  for (auto* pair : {light_, pixels_, places_}) std::swap(pair[0], pair[1]);
  const uint64_t pixels = launch.pixel_count();
  for (int i = 0; i < 2; ++i) {
    grow(memory_, light_[i], pixels * planes);
    grow(memory_, pixels_[i], pixels * history_words);
    grow(memory_, places_[i], pixels * place_words);
  }
  grow(memory_, guides_, guide_words(uint32_t(pixels)));
  write_views();
  write_poses(scene);
  images.last_light = memory_.address(*light_[0]);
  images.next_light = memory_.address(*light_[1]);
  images.last_pixels = memory_.address(*pixels_[0]);
  images.next_pixels = memory_.address(*pixels_[1]);
  images.last_places = memory_.address(*places_[0]);
  images.places = memory_.address(*places_[1]);
  images.last_guides = memory_.address(*guides_);
  images.temporal_weight = launch.temporal_weight;
  has_last_ = !views_.empty();
  images.has_last = has_last_ ? 1 : 0;
  views_.clear();
  next_views_ = launch.views;
  width_ = launch.width;
  height_ = launch.height;
  planes_ = planes;
}

void History::describe(GuidePush& push) const {
  push.places = memory_.address(*places_[1]);
  push.last_views = last_views_.address();
  push.last_local_to_world = last_poses_.address();
  push.history = has_last_ ? 2 : 1;
}

void History::write_views() {
  const auto records = last_views_.resize(memory_, views_.size());
  for (size_t i = 0; i < views_.size(); ++i) {
    const CameraRecord camera = camera_record(views_[i]);
    records[i] = {motion_view(views_[i]), camera.motion, camera.seconds_per_pixel};
  }
}

// The rows of an instance that the last launch did not know are zeros.
void History::write_poses(const Scene& scene) {
  const std::vector<uint32_t>& slots = scene.instance_slots();
  const auto rows = last_poses_.resize(memory_, slots.size() * 3);
  poses_.resize(slots.size());
  for (size_t slot = 0; slot < slots.size(); ++slot) {
    Pose& pose = poses_[slot];
    const uint32_t id = slots[slot];
    for (size_t i = 0; i < 3; ++i) rows[3 * slot + i] = pose.instance == id ? pose.rows[i] : glm::vec4(0.0f);
    pose.instance = id;
    if (id == none) continue;
    const glm::dmat4 transposed = glm::transpose(scene.instances()[id].local_to_world);
    for (int i = 0; i < 3; ++i) pose.rows[i] = glm::vec4(transposed[i]);
  }
}

}  // namespace kuafu
