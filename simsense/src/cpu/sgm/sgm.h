// SPDX-License-Identifier: Apache-2.0
// Cost, aggregation, winner and checks of the CPU matcher: everything between census and median, which share their passes over the image.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <thread>

#include "cpu/census/census.h"
#include "cpu/sgm/penalty_maps.h"
#include "match/matcher.h"

namespace simsense::cpu {

/// The progress of a stage that several threads share. Each thread asks between two pieces of work whether to go on; the thread that called
/// the matcher then tells its caller.
class Progress {
 public:
  /// The stage runs from share `begin` to share `end` of the whole, in `count` pieces.
  Progress(const std::function<void(float)>& tell, float begin, float end, size_t count)
      : tell_(tell), begin_(begin), scale_((end - begin) / static_cast<float>(count)) {}

  /// Call after each `pieces` of work, 0 inside a piece. Returns false if the caller's function threw: the work must then end.
  bool go_on(size_t pieces) {
    const size_t done = done_.fetch_add(pieces, std::memory_order_relaxed) + pieces;
    if (!tell_ || std::this_thread::get_id() != caller_) return !stopped_.load(std::memory_order_relaxed);
    try {
      tell_(begin_ + scale_ * static_cast<float>(done));
    } catch (...) {
      stopped_.store(true, std::memory_order_relaxed);
      throw;
    }
    return true;
  }

 private:
  const std::function<void(float)>& tell_;
  float begin_, scale_;
  std::thread::id caller_ = std::this_thread::get_id();
  std::atomic<size_t> done_{0};
  std::atomic<bool> stopped_{false};
};

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
