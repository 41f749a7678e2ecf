// The wavefront path tracer: generate, then per bounce closest, shade, occluded, resolve, then accumulate; in waves of bounded memory.
// At last what the frame holds is developed: steps on whole images, then the caller's formats.
// Results depend on the launch alone: per-path sums in a fixed order, samples keyed by view, pixel and index.
// Thread rule: externally synchronised.
#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "accel/tracer.h"
#include "denoise/denoiser.h"
#include "film/film.h"
#include "pathtrace/accumulation.h"
#include "pathtrace/aov_tables.h"
#include "pathtrace/frame.h"
#include "pathtrace/launch.h"
#include "pathtrace/scene_tables.h"
#include "pathtrace/stages.h"
#include "pathtrace/wave_slots.h"

namespace kuafu {

/// What a render came to.
struct RenderSummary {
  uint32_t samples = 0, call_samples = 0;  // in the images; of those, this call's
  double relative_error;                   // NaN where none was aimed at
  double seconds = 0.0;
};

enum class TracerKind { automatic, embree, compute, rt_pipeline };

class PathTracer {
 public:
  /// Throws KS_ERROR_UNSUPPORTED for Embree on a device whose memory the host does not share.
  /// oidn_library: path of Open Image Denoise; empty: wherever it is found.
  PathTracer(std::shared_ptr<ks::Device> device, TracerKind tracer, std::string oidn_library = {});
  ~PathTracer();

  /// Blocks until the outputs are written. Throws KS_ERROR_CANCELLED when the launch's callback says so.
  void render(const std::shared_ptr<const Scene>& scene, const Launch& launch);
  /// Milliseconds per stage of the last render.
  [[nodiscard]] const std::vector<std::pair<std::string, double>>& stage_times() const { return stage_times_; }
  [[nodiscard]] const RenderSummary& summary() const { return summary_; }
  [[nodiscard]] const std::shared_ptr<ks::Device>& device() const { return device_; }

 private:
  class Run;   // one render call
  class Wave;  // one wave of it
  [[nodiscard]] Memory memory() const { return {device_, on_host_}; }

  std::shared_ptr<ks::Device> device_;
  bool on_host_;  // rays and stages on worker threads
  std::unique_ptr<Tracer> tracer_;
  std::unique_ptr<Stages> stages_;
  SceneTables tables_;
  AovTables aov_tables_;
  WaveSlots slots_;
  std::shared_ptr<ks::Buffer> sums_;  // of passes over the same pixels
  Frame frame_;
  Accumulation accumulation_;
  Denoiser denoiser_;
  FilmOptics film_;
  MappedTable<ViewRecord> views_;
  MappedTable<CameraRecord> cameras_;
  MappedTable<OutputRecord> outputs_;
  // Tracer and tables know a scene by its address, so the last one lives until both have taken the next.
  std::shared_ptr<const Scene> scene_, next_scene_;
  std::unique_ptr<ks::Commands> commands_;  // null during a render, and after one that failed
  std::vector<std::pair<std::string, double>> stage_times_;
  RenderSummary summary_{0, 0, std::numeric_limits<double>::quiet_NaN(), 0.0};
};

}  // namespace kuafu
