// SPDX-License-Identifier: Apache-2.0
// A call as the caller asks for it: its images, checked against the rig and made reachable for a back end.
#pragma once

#include <optional>
#include <vector>

#include "device/timeline.h"
#include "image/layout.h"
#include "ks/log.h"
#include "stages/settings.h"

namespace simsense {

struct ComputeRequest {
  ImageArgument left, right;
  std::optional<ImageArgument> lasers[2];  // both or none
  std::optional<ImageArgument> rgb;
  struct Output {
    uint32_t output = 0;  // SIMSENSE_OUTPUT_*
    ImageArgument image;
  };
  std::vector<Output> outputs;
  std::vector<uint64_t> noise_seeds;  // of each pair; empty: the parameters'
  ks_progress_fn progress = nullptr;
  void* progress_user = nullptr;
  ks::TimelinePoint wait;  // what comes before its buffers are read or written

  /// Whether any image lies in host memory.
  [[nodiscard]] bool has_host_image() const;
  /// Tells the caller the finished share of the whole. Throws KS_ERROR_CANCELLED if the caller cancels.
  void tell_progress(uint32_t pair, uint32_t pairs, float done_of_pair) const;
};

/// Throws KS_ERROR_INVALID_ARGUMENT for images that a request must not have, before any is opened.
void check_request(const ComputeRequest& request, const PreparedRig& rig, const StageSettings& settings);

const char* output_name(uint32_t output);
ImageShape output_shape(uint32_t output, const PreparedRig& rig);

/// Opens all images of a checked request. open(argument, shape, name) returns an image of the frame, or throws.
template <class Frame, class Open>
void open_frame(const ComputeRequest& request, const PreparedRig& rig, Frame& frame, const Open& open) {
  const ImageShape light{rig.rig.batch_count, rig.height(), rig.width(), 0};
  frame.inputs[0].emplace(open(request.left, light, "left image"));
  frame.inputs[1].emplace(open(request.right, light, "right image"));
  if (request.lasers[0]) {
    frame.lasers[0].emplace(open(*request.lasers[0], light, "left laser image"));
    frame.lasers[1].emplace(open(*request.lasers[1], light, "right laser image"));
  }
  if (request.rgb) frame.rgb.emplace(open(*request.rgb, {rig.rig.batch_count, rig.rig.rgb.height, rig.rig.rgb.width, 3}, "rgb image"));
  for (const ComputeRequest::Output& wanted : request.outputs)
    frame.outputs[wanted.output].emplace(open(wanted.image, output_shape(wanted.output, rig), output_name(wanted.output)));
}

}  // namespace simsense
