// Cost, aggregation, winner and checks of the CPU matcher: everything between census and median, which share their passes over the image.
#pragma once

#include <memory>

#include "cpu/census.h"
#include "matcher.h"

namespace simsense::cpu {

/// Call every sweep, then every band; sweeps may run at the same time as each other, and so may bands.
class Aggregation {
 public:
  virtual ~Aggregation() = default;
  [[nodiscard]] virtual size_t sweep_count() const = 0;
  /// Follows the vertical paths of some columns and leaves checkpoints.
  virtual void sweep(size_t index) = 0;
  [[nodiscard]] virtual size_t band_count() const = 0;
  /// Disparities of one band of rows, before the median; disparity is the whole packed map.
  virtual void match_band(size_t index, float* disparity) = 0;
};

/// How far the census planes must reach to the left of the image: the largest disparity and half the widest block.
size_t left_reach(const MatchParameters& parameters);

/// The engine with the narrowest lanes in which all sums fit. The planes are read during sweep and match_band.
std::unique_ptr<Aggregation> make_aggregation(const CensusPlanes& left, const CensusPlanes& right, size_t width, size_t height,
                                              const MatchParameters& parameters, size_t threads);

}  // namespace simsense::cpu
