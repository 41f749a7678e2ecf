// SPDX-License-Identifier: Apache-2.0
// A run is one render call. Thread rule: externally synchronised, as are the parts that it works with.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>

#include "denoise/denoiser.h"
#include "device/buffer.h"
#include "frame/device_array.h"
#include "frame/frame.h"
#include "optics/optics.h"
#include "pathtrace/path_tracer.h"
#include "shared/wave.h"

namespace kuafu {

/// The outcome of a render.
struct RenderSummary {
  uint32_t samples = 0, call_samples = 0;                            // in the images; of those, this call's
  double relative_error = std::numeric_limits<double>::quiet_NaN();  // NaN where none was aimed at
  double seconds = 0.0;
};

/// A budget says how many samples the next round of a render takes where a limit of time or noise ends it.
class Budget {
 public:
  /// Each of the `pixels` gets at most `samples`. A limit of 0 is none.
  Budget(uint32_t samples, uint32_t pixels, double max_seconds, double relative_error);

  /// The samples of the next round; 0 when the render is done. Without a limit of time they depend on the errors alone, so they are
  /// deterministic.
  [[nodiscard]] uint32_t next() const { return next_; }
  /// Call it after the round that next() gave: `seconds` have passed since the call began, and the images have `all_samples` and this
  /// relative error.
  void round_done(double seconds, uint32_t all_samples, double relative_error);
  [[nodiscard]] uint32_t done() const { return done_; }

 private:
  uint32_t samples_, next_, done_ = 0;
  double max_seconds_, relative_error_, seconds_ = 0;
};

/// The relative error of an image: the root of the mean variance of its pixels over its mean radiance. The function returns its upper limit
/// at 84 % confidence, since few pixels or rare bright samples tell little about the variance. Both images hold [pixels][channels] floats.
double relative_error(const ks::Buffer& variance, const ks::Buffer& radiance, uint64_t pixels, uint32_t channels);

/// An accumulation keeps the sums of whole images between the rounds of a budget, and between calls that accumulate.
class Accumulation {
 public:
  /// A later call can add to the sums if it has the same shape.
  struct Shape {
    uint32_t views = 0, width = 0, height = 0, channels = 0, groups = 0;
    bool replicates = false, denoised = false;
    bool operator==(const Shape&) const = default;
  };

  explicit Accumulation(Memory memory) : memory_(std::move(memory)) {}

  /// Keeps the sums if `continues` is set and they have this shape; else starts again at `first_sample`.
  void begin(const Shape& shape, bool continues, uint32_t first_sample) {
    if (continues && sums_ && shape == shape_) return;
    clear();
    shape_ = shape;
    first_sample_ = first_sample;
    const uint64_t planes = uint64_t(shape.channels) * (shape.groups + (shape.replicates ? replicate_count : 0));
    sums_ = ks::Buffer::create(memory_.device, planes * pixel_count() * 4, memory_.device->is_cpu() ? KS_BUFFER_HOST_VISIBLE : 0);
  }
  void add(uint32_t samples) { samples_ += samples; }
  /// Drops the sums and frees their memory.
  void clear() { *this = Accumulation(memory_); }

  [[nodiscard]] uint64_t address() const { return memory_.address(*sums_); }
  [[nodiscard]] uint32_t pixel_count() const { return shape_.views * shape_.width * shape_.height; }
  [[nodiscard]] uint32_t first_sample() const { return first_sample_; }
  [[nodiscard]] uint32_t samples() const { return samples_; }

 private:
  Memory memory_;
  Shape shape_;
  std::shared_ptr<ks::Buffer> sums_;
  uint32_t first_sample_ = 0, samples_ = 0;
};

/// The parts that render calls work with, one after the other; they keep memory and tables between the calls.
struct RenderParts {
  RenderParts(const std::shared_ptr<ks::Device>& device, TracerKind tracer, std::string oidn_library)
      : paths(device, tracer),
        frame(paths.memory()),
        accumulation(paths.memory()),
        denoiser(paths.memory(), paths.queue_layout(), std::move(oidn_library)),
        optics(paths.memory()) {}

  PathTracer paths;
  Frame frame;
  Accumulation accumulation;
  std::shared_ptr<ks::Buffer> batch_sums;  // of passes over the same pixels, where no accumulation keeps them
  Denoiser denoiser;
  CameraOptics optics;
};

/// Takes one launch through its rounds of samples and the steps on whole images.
class RenderRun {
 public:
  RenderRun(RenderParts& parts, const Launch& launch, ks::Commands& commands)
      : parts_(parts),
        launch_(launch),
        commands_(commands),
        budget_(launch.samples, launch.pixel_count(), launch.max_seconds, launch.relative_error) {}
  void prepare(const Scene& scene);
  void render();
  [[nodiscard]] RenderSummary summary() const {
    return {.samples = all_samples(), .call_samples = budget_.done(), .relative_error = relative_error_, .seconds = seconds()};
  }

 private:
  void check_countable() const;
  void begin_accumulation();
  void render_round();
  void finish_round();
  void render_surfaces(uint32_t first_pixel, uint32_t pixel_count);
  void render_pixels(uint32_t first_pixel, uint32_t pixel_count);
  void develop();
  void denoise();
  /// Traces rays over the squares of so many pixels, which the denoiser asked for, and takes their waves through `step`.
  void in_squares(uint32_t pixels, const std::function<void(Wave&)>& step);
  void report(uint32_t pixels_done, float part);

  [[nodiscard]] const Memory& memory() const { return parts_.paths.memory(); }
  [[nodiscard]] bool denoises() const { return launch_.denoise != DenoiseKind::none && launch_.wants_radiance(); }

  /// Whether later rounds or calls go on with the sums.
  [[nodiscard]] bool keeps_sums() const { return (launch_.accumulate || launch_.has_budget()) && launch_.wants_radiance(); }
  /// The number of planes of pixels that are summed.
  [[nodiscard]] uint32_t sum_planes() const {
    return launch_.band.channels() * (parts_.paths.plan().groups + (launch_.wants_variance() ? replicate_count : 0));
  }
  /// The place of the sums of a batch of pixels.
  [[nodiscard]] PixelSums sums_of(uint32_t first_pixel, uint32_t pixel_count) const;
  /// The samples that the sums had before the round that is being rendered.
  [[nodiscard]] uint32_t samples_before() const { return keeps_sums() ? parts_.accumulation.samples() : 0; }
  /// The samples in the images: those of this call and of the calls that it went on with.
  [[nodiscard]] uint32_t all_samples() const { return samples_before() + (keeps_sums() ? 0 : budget_.done()); }
  [[nodiscard]] uint32_t first_sample() const { return keeps_sums() ? parts_.accumulation.first_sample() : launch_.first_sample; }
  [[nodiscard]] double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

  RenderParts& parts_;
  const Launch& launch_;
  ks::Commands& commands_;
  Budget budget_;
  double relative_error_ = std::numeric_limits<double>::quiet_NaN();
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace kuafu
