// The matcher: a rectified 8-bit pair in, a disparity map out (census, Hamming cost, block sum, semi-global aggregation, winner,
// uniqueness, subpixel, left-right check, median). One interface, several back ends that give the same bits: the scalar reference, the CPU
// (SIMD), later Vulkan compute. Thread rule: externally synchronised.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "ks/log.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// Where between whole disparities the match lies, from the costs at winner - 1, winner and winner + 1.
enum class Subpixel : uint8_t {
  none,
  parabola,     // vertex of the parabola through the aggregated costs, as the published SimSense; pulls towards whole pixels by up to 0.2
  equiangular,  // apex of the V through the block's costs; through the aggregated ones where the block is 1x1 or has no minimum there
};

/// Ranges are those of simsense_parameters (simsense.h), already checked.
struct MatchParameters {
  uint32_t census_width = 7, census_height = 7;
  uint32_t max_disparity = 128;
  uint32_t block_width = 1, block_height = 1;
  uint32_t p1 = 7, p2 = 86;
  uint32_t uniqueness_ratio = 15;
  int32_t lr_max_diff = 1;  // -1 = off
  uint32_t median_size = 3;
  Subpixel subpixel = Subpixel::equiangular;
  bool operator==(const MatchParameters&) const = default;
};

struct ConstImage {
  const uint8_t* data = nullptr;
  ptrdiff_t row_stride = 0;  // elements
};

class Matcher {
 public:
  virtual ~Matcher() = default;
  /// disparity: [height][width] packed, pixels, -1 = invalid.
  virtual void match(ConstImage left, ConstImage right, float* disparity) = 0;
  /// Milliseconds of each stage of the last match.
  [[nodiscard]] virtual std::vector<ks_stage_time> stage_times() const = 0;
};

std::unique_ptr<Matcher> make_reference_matcher(uint32_t width, uint32_t height, const MatchParameters& parameters);
std::unique_ptr<Matcher> make_cpu_matcher(uint32_t width, uint32_t height, const MatchParameters& parameters, ks::ThreadPool& workers);

}  // namespace simsense
