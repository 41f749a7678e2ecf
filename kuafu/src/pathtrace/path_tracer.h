// SPDX-License-Identifier: Apache-2.0
// The wavefront path tracer takes waves of paths, of bounded memory, through its stages: generate, then for each bounce closest, shade,
// occluded and resolve, at last accumulate. It owns the rays and what they read: the tracer, the stages, the scene's tables and the waves'
// memory. The images belong to its caller. Results depend on the launch alone, since each path sums its own light in a fixed order and
// samples are keyed by view, pixel and index.
// Thread rule: externally synchronised.
#pragma once

#include <functional>
#include <memory>

#include "frame/launch.h"
#include "pathtrace/splats.h"
#include "pathtrace/wave.h"
#include "tables/scene_tables.h"

namespace kuafu {

enum class TracerKind { automatic, embree, compute, rt_pipeline };

class PathTracer {
 public:
  /// Throws KS_ERROR_UNSUPPORTED for Embree on a device whose memory the host does not share.
  PathTracer(const std::shared_ptr<ks::Device>& device, TracerKind tracer);

  [[nodiscard]] const Memory& memory() const { return backend_.memory; }
  [[nodiscard]] uint32_t queue_layout() const { return backend_.tracer->queue_layout(); }

  // Call these three before the first wave of a launch, in this order.

  /// Brings the tables that stages read up to date with the scene and the launch.
  void update_tables(const Scene& scene, const Launch& launch);
  /// Makes room for the launch's waves. rays_per_square says how many rays waves over pixels' squares will have; 0: there will be none.
  void fit(const Launch& launch, uint32_t rays_per_square);
  /// Brings the tracer's acceleration structure up to date.
  void update_tracer(const Scene& scene, const Launch& launch);

  /// Traces light through glass to the surfaces where it arrives. Call before waves of paths that begin with this sample.
  void splat_light(ks::Commands& commands, const Launch& launch, uint32_t first_sample);

  /// The plan of the launch that the tables were updated for.
  [[nodiscard]] const WavePlan& plan() const { return plan_; }
  /// Pixels that in_waves takes together: with the samples of one pass, or with rays over their squares.
  [[nodiscard]] uint32_t pixels_per_batch() const { return pixels_per_batch_; }
  [[nodiscard]] uint32_t squares_per_batch() const;
  /// Takes a batch through `step`: on a device as one wave, on the host as one wave per worker's slot, in parallel.
  void in_waves(ks::Commands& commands, const Launch& launch, const WaveRange& batch, const std::function<void(Wave&)>& step);
  [[nodiscard]] WaveRange range(const Launch& launch, uint32_t first_pixel, uint32_t pixel_count, uint32_t first_sample,
                                uint32_t sample_count) const;
  /// Brings the stage times of the host's waves, means of all workers, to `commands` and forgets them.
  void collect_times(ks::Commands& commands) { slots_.collect_times(commands); }

 private:
  [[nodiscard]] WavePlan plan_of(const Launch& launch, bool special_cameras) const;

  WaveBackend backend_;
  SceneTables tables_;
  AovTables aov_tables_;
  MappedTable<ViewRecord> views_;
  MappedTable<CameraRecord> cameras_;
  WaveSlots slots_;
  Splats splats_;
  WavePlan plan_;
  uint32_t pixels_per_batch_ = 0, rays_per_square_ = 0;
};

}  // namespace kuafu
