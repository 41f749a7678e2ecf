// SPDX-License-Identifier: Apache-2.0
// A wave is a batch of paths, or of rays through pixels, on its way through the stages. Thread rule: any thread, one at a time for a slot's
// memory.
#pragma once

#include "accel/tracer.h"
#include "frame/image_step.h"
#include "frame/launch.h"
#include "pathtrace/stages.h"
#include "pathtrace/wave_memory.h"

namespace kuafu {

/// The tracer and stages of a wave.
struct WaveBackend {
  Memory memory;
  std::unique_ptr<Tracer> tracer;
  std::unique_ptr<Stages> stages;
};

/// Values that all waves of a launch share: addresses of tables, and the scene's needs.
struct WavePlan {
  uint64_t scene = 0, views = 0, cameras = 0, aov = 0;  // addresses of the tables that stages read
  bool environments = false;                            // rays carry an environment
  bool camera = false;                                  // some view is more than a pinhole at rest
  bool motion = false;                                  // rays have a time
  bool medium = false;
  bool ambient = false;        // there is light that only BSDF rays find
  bool select_lights = false;  // each vertex asks one light, chosen by power
  bool passes_glass = false;   // shadow rays may pass something on their way
  bool bends = false;          // bodies of it bend light
  bool direct_apart = false;   // ambient light is kept apart that met one surface
  uint64_t splats = 0;         // address of the SplatTable, with bends
  uint32_t features = 0;       // feature_*
  uint32_t groups = 0;         // of light, kept apart
  uint32_t shadow_rays_per_vertex = 0;
  uint32_t last_lit = 0;     // the last pass that asks for light
  uint32_t last_bounce = 0;  // the last pass
};

/// The sums of pixels between passes: planes of pixel_count words, of the pixels from first_pixel on.
struct PixelSums {
  uint64_t address = 0;
  uint32_t first_pixel = 0, pixel_count = 0;
  uint32_t first_sample = 0;  // that the sums begin with
  bool outlive_call = false;  // later rounds or calls go on with them
};

class Wave {
 public:
  /// A batch of pixels and samples of the launch, or a part of one.
  Wave(const WaveBackend& backend, const Launch& launch, const WavePlan& plan, WaveBuffers& buffers, ks::Commands& commands,
       const WaveRange& range)
      : backend_(backend), launch_(launch), plan_(plan), buffers_(buffers), commands_(commands), range_(range) {}

  /// Traces rays through the middle of each pixel; rays() are the result.
  void trace_centres();
  /// After trace_centres, writes what the launch asks of the surfaces there. `outputs` is the address of an OutputArray.
  void write_aovs(uint64_t outputs);
  /// Traces the range's samples as rays over each pixel's square, for the pixels in `listed` (as GeneratePush.pixels; 0: all); rays() are
  /// the result.
  void trace_squares(uint64_t listed);
  /// Takes paths from the camera to their ends; state() then has the light that each of them found.
  void trace_paths();
  /// After trace_paths, adds the paths to their pixels. `last` says that no samples follow, so that `outputs` are written.
  void accumulate(const PixelSums& sums, uint64_t outputs, bool last);

  /// Takes beams push.first to push.first + push.count of light from their lights to where they land; the wave's memory has room for so
  /// many.
  void follow_beams(BeamPush push);

  [[nodiscard]] ks::Commands& commands() const { return commands_; }
  [[nodiscard]] WaveRays rays() const {
    return {.rays = buffers_.closest_rays(0), .scene = plan_.scene, .views = plan_.views, .range = range_};
  }
  [[nodiscard]] uint64_t state() const { return buffers_.state(); }
  [[nodiscard]] const WaveRange& range() const { return range_; }

 private:
  /// Runs stage `generate`; with generate_listed, `pixels` is GeneratePush.pixels.
  void generate(uint32_t flags, uint64_t pixels = 0);
  void shade(uint32_t bounce);
  [[nodiscard]] RayQueue of_scene(RayQueue rays) const;
  void trace_closest(uint32_t bounce, const char* stage = "trace closest");
  void trace_shadows(uint32_t bounce, const char* stage = "trace occluded");
  void trace_by_surfaces(uint32_t bounce);
  void resolve(uint32_t bounce);
  [[nodiscard]] ShadePush shade_push(uint32_t bounce) const;
  /// Whether shadow rays pass glass surface by surface, in queues of their own.
  [[nodiscard]] bool glass_shadows() const { return buffers_.size().glass_passes > 0; }
  [[nodiscard]] bool on_cpu_device() const { return backend_.memory.device->is_cpu(); }

  const WaveBackend& backend_;
  const Launch& launch_;
  const WavePlan& plan_;
  WaveBuffers& buffers_;
  ks::Commands& commands_;
  const WaveRange range_;
};

}  // namespace kuafu
