// SPDX-License-Identifier: Apache-2.0
// The matcher: a rectified pair in, a disparity map out (census, Hamming cost, block sum, semi-global aggregation, winner,
// uniqueness, subpixel, left-right check, median, refinement, detection). One interface, several back ends that give the same bits: the
// scalar reference, the CPU (SIMD), Vulkan compute. Thread rule: externally synchronised.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "device/thread_pool.h"
#include "ks/log.h"
#include "parameters/match_fields.h"
#include "shared/choices.h"
#include "shared/detection_push.h"

namespace simsense {

// The matcher's choices and reasons have the public header's numbers.
/// The pixels of the window that a census word compares.
enum class CensusKind : uint8_t {
  center_symmetric = CENSUS_CENTER_SYMMETRIC,  // each pixel with its mirror through the centre: half the bits
  plain = CENSUS_PLAIN,                        // each pixel with the centre
};

/// How a match is placed between whole disparities, from the costs at winner - 1, winner and winner + 1.
enum class Subpixel : uint8_t {
  none = SUBPIXEL_NONE,
  parabola = SUBPIXEL_PARABOLA,  // vertex of the parabola through the aggregated costs, as the published SimSense; pulls towards whole
                                 // pixels by up to 0.2
  equiangular = SUBPIXEL_EQUIANGULAR,  // apex of the V through the block's costs; through the aggregated ones where the block is 1x1 or has
                                       // no minimum there
  equiangular_summed = SUBPIXEL_EQUIANGULAR_SUMMED,  // through the aggregated ones everywhere: less noise, more pull
  lucas_kanade = SUBPIXEL_LUCAS_KANADE,  // the same, and after the median the counts themselves decide (match/refine.h): no pull
};

/// The value that an invalid pixel takes from its row (cpu/checks/checks.h).
enum class HoleFilling : uint8_t {
  keep = HOLES_KEEP,
  left = HOLES_LEFT,              // the valid pixel to the left: what a left camera's occlusions border on
  background = HOLES_BACKGROUND,  // the farther of the valid pixels to the left and right; either alone at the image's border (the
                                  // interpolation of the KITTI stereo benchmark's development kit: Geiger, Lenz, Urtasun, CVPR 2012)
};

/// Why a pixel has no measurement. A matcher knows the first five.
enum class MatchReason : uint8_t { MATCH_REASONS };

/// Parameters of a matcher: those of simsense_parameters, already checked. MatchFields holds the ones that keep name and value; the others
/// follow here.
struct MatchParameters : MatchFields {
  MatchParameters() { block_width = block_height = 1; }  // a matcher by itself sums no block
  explicit MatchParameters(const MatchFields& fields) : MatchFields(fields) {}
  CensusKind census_kind = CensusKind::center_symmetric;
  uint32_t census_contrast_256ths = 16;  // of the range of counts around a pixel; what does not differ by more counts as equal. 0 = off
  Subpixel subpixel = Subpixel::equiangular;
  uint32_t left_bits = 8, right_bits = 8;  // of a count; read where the images have 16-bit elements
  bool operator==(const MatchParameters&) const = default;

  /// How far beyond the census window the range of counts is taken.
  static constexpr uint32_t contrast_margin = 2;
  [[nodiscard]] uint32_t census_bits() const {
    return census_kind == CensusKind::plain ? census_width * census_height - 1 : (census_width * census_height - 1) / 2;
  }
  [[nodiscard]] uint32_t block_area() const { return block_width * block_height; }
  [[nodiscard]] bool refines() const { return subpixel == Subpixel::lucas_kanade; }
  [[nodiscard]] bool detects() const { return min_detection_sigma > 0; }
  /// Side of detection's window, px. Callers of an earlier header state none.
  [[nodiscard]] uint32_t detection_side() const { return detection_window == 0 ? 31 : detection_window; }
  /// The disparity of an invalid pixel, which is below every valid one.
  [[nodiscard]] float invalid_disparity() const { return static_cast<float>(min_disparity < 0 ? min_disparity - 1 : -1); }
};

struct ConstImage {
  const uint8_t* data = nullptr;
  ptrdiff_t row_stride = 0;    // elements
  uint32_t element_bytes = 1;  // 2: data points to uint16_t

  [[nodiscard]] uint32_t at(ptrdiff_t x, ptrdiff_t y) const {
    const ptrdiff_t i = y * row_stride + x;
    return element_bytes == 1 ? data[i] : reinterpret_cast<const uint16_t*>(data)[i];
  }
};

/// The maps of one match, packed [height][width].
struct MatchMaps {
  float* disparity = nullptr;     // pixels; invalid: MatchParameters::invalid_disparity(), -1 by default
  float* confidence = nullptr;    // if wanted: 1 - lowest cost / lowest cost of a disparity that is no neighbour of the winner; 0..1
  MatchReason* reason = nullptr;  // if wanted
  /// Takes a pixel's measurement away.
  void reject(size_t pixel, float invalid, MatchReason why) const {
    disparity[pixel] = invalid;
    if (reason) reason[pixel] = why;
    if (confidence) confidence[pixel] = 0;
  }
  MatchMaps(float* disparities) : disparity(disparities) {}  // implicit: disparities alone are the usual wish
};

/// The stages of a matcher, in the order of match_order. A back end implements each in the folder of its name. A stage does nothing if
/// another one does its work.
class MatchStages {
 public:
  virtual ~MatchStages() = default;
  virtual void census() = 0;
  /// Called if stores_costs(); otherwise each path computes its costs on demand.
  virtual void cost() = 0;
  virtual void sgm() = 0;
  virtual void winner() = 0;
  virtual void checks() = 0;
  /// Called if refines().
  virtual void refine() = 0;
  /// Called if detects().
  virtual void detection() = 0;
  [[nodiscard]] virtual bool stores_costs() const = 0;
  [[nodiscard]] virtual bool refines() const = 0;
  [[nodiscard]] virtual bool detects() const = 0;
};

struct MatchStep {
  const char* name;
  void (MatchStages::*run)();
};
inline constexpr MatchStep match_order[] = {
    {"census", &MatchStages::census},       {"cost", &MatchStages::cost},     {"sgm", &MatchStages::sgm},
    {"winner", &MatchStages::winner},       {"checks", &MatchStages::checks}, {"refine", &MatchStages::refine},
    {"detection", &MatchStages::detection},
};

/// Runs the stages in order. measure(name, run) calls run() and takes its time.
template <class Measure>
void run_match(MatchStages& stages, const Measure& measure) {
  for (const MatchStep& step : match_order) {
    const bool skipped = (step.run == &MatchStages::cost && !stages.stores_costs()) ||
                         (step.run == &MatchStages::refine && !stages.refines()) ||
                         (step.run == &MatchStages::detection && !stages.detects());
    if (!skipped) measure(step.name, [&] { (stages.*step.run)(); });
  }
}

/// A matcher of images in host memory: the scalar reference, or a back end in tests and benchmarks.
class Matcher {
 public:
  virtual ~Matcher() = default;
  /// Matches a pair. Both images have the same element size.
  virtual void match(ConstImage left, ConstImage right, const MatchMaps& maps) = 0;
  /// Milliseconds of each stage of the last match.
  [[nodiscard]] virtual std::vector<ks_stage_time> stage_times() const = 0;
  /// progress: called now and then with the finished share of match(), 0..1, on the caller's thread. An exception that it throws ends
  /// match().
  void set_progress(std::function<void(float)> progress) { progress_ = std::move(progress); }
  /// noise: of the next images; detection compares them with it.
  void set_noise(const DetectionNoise& noise) { noise_ = noise; }

 protected:
  DetectionNoise noise_{0, 0, 0, 1};
  std::function<void(float)> progress_;
};

std::unique_ptr<Matcher> make_reference_matcher(uint32_t width, uint32_t height, const MatchParameters& parameters);
std::unique_ptr<Matcher> make_cpu_matcher(uint32_t width, uint32_t height, const MatchParameters& parameters, ks::ThreadPool& workers);

/// A rectangle of pixels, [x0, x1) x [y0, y1), of the rectified left image.
struct Region {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  bool operator==(const Region&) const = default;
};

/// Returns the part of an image that must be matched for a region's disparities: the region, the columns that its disparities reach, and a
/// margin for the paths.
Region reach(const Region& region, const MatchParameters& parameters, uint32_t width, uint32_t height);

}  // namespace simsense
