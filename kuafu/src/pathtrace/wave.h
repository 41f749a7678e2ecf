// One wave of paths, or of rays through pixels, on its way through the stages. Thread rule: any thread, one at a time for a slot's memory.
#pragma once

#include "pathtrace/render_run.h"

namespace kuafu {

class PathTracer::Wave {
 public:
  /// A part of the run's batch: its pixels and samples.
  Wave(const Run& run, WaveBuffers& buffers, ks::Commands& commands, const WaveRange& range)
      : run_(run), o_(run.o_), launch_(run.launch_), b_(buffers), commands_(commands), range_(range) {}
  /// AOVs and the denoiser's guides, of rays through pixel centres.
  void render_aovs();
  /// last: no more samples follow, so outputs are written.
  void render_paths(bool last);
  /// What the denoiser asks over each pixel's square.
  void blend_guides();
  void remodulate();

 private:
  void aov();
  void trace_paths();
  /// pixels: with generate_listed, as GeneratePush has it.
  void generate(uint32_t flags, uint64_t pixels = 0);
  void shade(uint32_t bounce);
  void trace_closest(uint32_t bounce, const char* stage = "trace closest");
  void trace_shadows(uint32_t bounce, const char* stage = "trace occluded");
  void trace_by_surfaces(uint32_t bounce);
  void resolve(uint32_t bounce);
  void accumulate(bool last);
  /// Shadow rays pass glass surface by surface, in queues of their own.
  [[nodiscard]] bool glass_shadows() const { return b_.size().glass_surfaces > 0; }
  [[nodiscard]] WaveRays rays() const { return {b_.closest_rays(0), o_.tables_.address(), o_.views_.address(), range_}; }

  const Run& run_;
  PathTracer& o_;
  const Launch& launch_;
  WaveBuffers& b_;
  ks::Commands& commands_;
  const WaveRange range_;
};

}  // namespace kuafu
