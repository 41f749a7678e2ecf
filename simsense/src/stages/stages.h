// SPDX-License-Identifier: Apache-2.0
// The stages of a pair, one function each; a back end implements each in the folder of its name. Their order is here once, for both back
// ends.
#pragma once

#include <functional>

#include "image/layout.h"
#include "match/matcher.h"
#include "stages/settings.h"

namespace simsense {

/// The stages that the outputs of a call need.
struct Needs {
  bool disparity = false, confidence = false, reason = false;
  bool depth = false;       // disparities or depths for the caller, or points of the left camera
  bool registered = false;  // depth or points in the RGB camera
  bool points = false;

  template <class Frame>
  Needs(const Frame& frame, bool has_rgb)
      : disparity(frame.wants_disparity()),
        confidence(frame.wants(SIMSENSE_OUTPUT_CONFIDENCE)),
        reason(frame.wants(SIMSENSE_OUTPUT_REASON)),
        depth(frame.wants(SIMSENSE_OUTPUT_DISPARITY) || frame.wants(SIMSENSE_OUTPUT_DEPTH) || (frame.wants_points() && !has_rgb)),
        registered(has_rgb && (frame.wants(SIMSENSE_OUTPUT_DEPTH_RGB) || frame.wants_points())),
        points(frame.wants_points()) {}
};

/// One back end's stages, for the pairs that it was given.
class Stages {
 public:
  virtual ~Stages() = default;

  // both cameras' light to what the matcher sees
  virtual void signal() = 0;
  virtual void rectify() = 0;

  /// The matcher, set to these pairs' images and maps.
  virtual MatchStages& matcher() = 0;

  // on the matcher's maps
  virtual void place_region() = 0;
  virtual void drop_padding() = 0;
  virtual void drop_low_texture() = 0;
  virtual void filter_speckles() = 0;
  virtual void drop_edges() = 0;
  virtual void fill_holes() = 0;

  // from disparities on
  virtual void depth() = 0;
  virtual void registration() = 0;
  virtual void points() = 0;  // only where makes_points_apart(); else depth and registration make them
  virtual void reason() = 0;
  virtual void store_maps() = 0;  // confidence and reasons

  [[nodiscard]] virtual bool makes_points_apart() const = 0;
  /// Runs or records a stage, and takes its time.
  virtual void measure(const char* name, const std::function<void()>& run) = 0;
};

/// Runs the stages that the settings and outputs ask for, in order.
void run_stages(Stages& stages, const StageSettings& settings, const Needs& needs);

}  // namespace simsense
