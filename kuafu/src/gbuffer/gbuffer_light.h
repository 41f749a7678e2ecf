// SPDX-License-Identifier: Apache-2.0
// Light on G-buffers: what infrared pairs see of surfaces that another renderer gives as depth, normals, albedos and materials. Takes the
// place of paths; the frame, the optics and the caller's formats are those of every render. Thread rule: externally synchronised.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "device/thread_pool.h"
#include "frame/frame.h"
#include "frame/image_step.h"
#include "scene/scene.h"
#include "shared/gbuffer_record.h"
#include "tables/scene_tables.h"

namespace kuafu {

/// A projector's pattern as pixels see it: means over a pixel's square and a beam's disc, for discs of several sizes
/// (lib/pattern_mean.glsl).
struct PatternStack {
  std::vector<float> means;  // [level][height][width], with a border of one mean around the pattern
  uint32_t width = 0, height = 0, levels = 0;
  float step_px = 1.0f;
};

/// Makes the means of a pattern over discs of several diameters. pixel_px: a camera pixel's size on the pattern along u and v, in the
/// pattern's pixels. most_diameter_px: the largest disc.
PatternStack pattern_stack(const Texture& pattern, glm::dvec2 pixel_px, double most_diameter_px, ks::ThreadPool& workers);

/// Images of one camera in all environments, packed; a null buffer is absent.
struct GbufferImages {
  std::shared_ptr<ks::Buffer> depth, normal, albedo, material;
};

/// A pair of rectified cameras in many environments. launch.views: all left ones, then all right ones.
struct GbufferLaunch {
  Launch launch;
  uint32_t supersampling = 1;  // given pixels along each side of a pixel of the launch
  std::array<GbufferImages, 2> given;
  std::shared_ptr<ks::Buffer> projector_depth;
  bool along_rays = false, laser_as_one = false;  // as in gbuffer_record.h
  std::vector<float> power, ambient;              // by environment

  [[nodiscard]] uint32_t environments() const { return uint32_t(launch.views.size() / 2); }
};

class GbufferLight {
 public:
  explicit GbufferLight(Memory memory);
  /// Lights the surfaces and writes the frame's images. Call check() when the commands have run.
  void run(ks::Commands& commands, const Scene& scene, const GbufferLaunch& gbuffers, const Frame& frame);
  /// Throws for invalid input images, with the environment, the pixel and the value.
  void check(const GbufferLaunch& gbuffers) const;

 private:
  void fit(const GbufferLaunch& gbuffers);
  void prepare_pattern(const Scene& scene, const GbufferLaunch& gbuffers);
  GbufferRecord record_of(const Scene& scene, const GbufferLaunch& gbuffers, const Frame& frame);
  [[nodiscard]] GbufferCamera camera_of(const GbufferLaunch& gbuffers, uint32_t camera) const;

  /// The inputs of a pattern's means.
  struct PatternKey {
    std::shared_ptr<const void> scene;  // its identity
    uint32_t texture = none;
    uint64_t revision = 0;
    std::shared_ptr<const Texture> raster;  // kept, so that no other has its address
    glm::dvec2 pixel_px{0.0};
    double diameter_px = 0.0;
    bool operator==(const PatternKey&) const = default;
  };

  Memory memory_;
  SceneTables tables_;
  ImageStep<GbufferPush> step_;
  Frame samples_;  // under supersampling
  MappedTable<GbufferRecord> record_;
  MappedTable<float> power_, ambient_;
  MappedTable<uint32_t> places_, measured_;  // of materials
  std::shared_ptr<ks::Buffer> inverse_[2], source_, projector_inverse_, matt_, lobes_, laser_, lobe_pixels_, cells_, errors_, means_;
  PatternMeans pattern_{};
  PatternKey pattern_key_;
  const Light* projector_ = nullptr;  // of this run
  uint32_t materials_ = 0;
};

namespace host {
/// Thread rule: any thread; ranges of a step are independent.
void gbuffer(const GbufferPush& push, uint32_t first, uint32_t end);
}  // namespace host

}  // namespace kuafu
