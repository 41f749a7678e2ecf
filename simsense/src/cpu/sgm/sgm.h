// SPDX-License-Identifier: Apache-2.0
// Cost, aggregation, winner and checks of the CPU matcher: everything between census and median, which share their passes over the image.
#pragma once

#include <memory>

#include "cpu/census/census.h"
#include "cpu/sgm/penalty_maps.h"
#include "cpu/sgm/progress.h"
#include "match/matcher.h"

namespace simsense::cpu {

/// Call every sweep, then every band; sweeps may run at the same time as each other, and so may bands.
class Aggregation {
 public:
  virtual ~Aggregation() = default;
  [[nodiscard]] virtual size_t sweep_count() const = 0;
  /// Follows paths up or down the image and leaves checkpoints.
  virtual void sweep(size_t index, Progress& progress) = 0;
  [[nodiscard]] virtual size_t band_count() const = 0;
  /// One band of rows of the whole maps, before the median.
  virtual void match_band(size_t index, const MatchMaps& maps, Progress& progress) = 0;
  /// All bands' pieces of work, as match_band counts them; a sweep is one.
  [[nodiscard]] virtual size_t strip_count() const = 0;
};

/// How far the census planes must reach to the left of the image: the largest disparity and half the widest block.
size_t left_reach(const MatchParameters& parameters);

/// The engine with the narrowest lanes in which all sums fit. Planes and maps are read during sweep and match_band.
std::unique_ptr<Aggregation> make_aggregation(const CensusPlanes& left, const CensusPlanes& right, const PenaltyMaps& maps, size_t width,
                                              size_t height, const MatchParameters& parameters, size_t threads);

}  // namespace simsense::cpu
