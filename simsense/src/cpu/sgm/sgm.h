// SPDX-License-Identifier: Apache-2.0
// Cost, aggregation, winner and checks of the CPU matcher: everything between census and median, which share their passes over the image.
#pragma once

#include <memory>

#include "cpu/census/census.h"
#include "cpu/sgm/penalty_maps.h"
#include "cpu/sgm/progress.h"
#include "match/matcher.h"

namespace simsense::cpu {

/// Semi-global aggregation. Call every sweep, then every band; sweeps may run in parallel, and so may bands.
class Aggregation {
 public:
  virtual ~Aggregation() = default;
  [[nodiscard]] virtual size_t sweep_count() const = 0;
  /// Follows paths up or down the image and keeps checkpoints.
  virtual void sweep(size_t index, Progress& progress) = 0;
  [[nodiscard]] virtual size_t band_count() const = 0;
  /// Matches one band of rows of the whole maps, before the median.
  virtual void match_band(size_t index, const MatchMaps& maps, Progress& progress) = 0;
  /// The pieces of work of all bands, as match_band counts them; a sweep is one piece.
  [[nodiscard]] virtual size_t strip_count() const = 0;
};

/// Columns left of the image that the census planes must have: the largest disparity and half the widest block.
size_t left_reach(const MatchParameters& parameters);

/// Makes the engine with the narrowest lanes that hold all sums. It reads the planes and maps in sweep and match_band.
std::unique_ptr<Aggregation> make_aggregation(const CensusPlanes& left, const CensusPlanes& right, const PenaltyMaps& maps, size_t width,
                                              size_t height, const MatchParameters& parameters, size_t threads);

}  // namespace simsense::cpu
