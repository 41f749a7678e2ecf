// The pipeline: signal, rectification, matching, depth, registration, points, for a batch of image pairs: on the CPU one pair after the
// other, or all of it on a GPU (vulkan/pipeline.h).
// A stage writes straight into the caller's memory where that is packed; scratch memory is kept between calls.
// Thread rule: externally synchronised.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "depth/points.h"
#include "depth/registration.h"
#include "disparity/holes.h"
#include "disparity/speckle.h"
#include "frame.h"
#include "ks/sync.h"
#include "parameters/parameters.h"
#include "rectify/rectification.h"
#include "signal/imager.h"
#include "stage_clock.h"

namespace simsense {

class VulkanPipeline;

struct ComputeRequest {
  ImageArgument left, right;
  std::optional<ImageArgument> lasers[2];  // both or none
  std::optional<ImageArgument> rgb;
  struct Output {
    uint32_t output = 0;  // SIMSENSE_OUTPUT_*
    ImageArgument image;
  };
  std::vector<Output> outputs;
  ks_progress_fn progress = nullptr;
  void* progress_user = nullptr;
};

class Engine {
 public:
  Engine(std::shared_ptr<ks::Device> device, const simsense_rig_desc& rig, const simsense_parameters& parameters);
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  /// A refused set leaves the old one in force.
  void set_parameters(const simsense_parameters& parameters);
  [[nodiscard]] const simsense_parameters& parameters() const { return parameters_; }
  void set_signal(const simsense_signal& left, const simsense_signal& right);
  [[nodiscard]] const simsense_signal& signal(uint32_t eye) const { return imagers_[eye].signal(); }
  [[nodiscard]] const StereoGeometry& geometry() const { return rectification_.geometry; }
  void compute(const ComputeRequest& request);
  /// compute() that returns before the work is done where that is possible: on a GPU with all images in its buffers. What the result says
  /// is what wait() takes; the images must live until then.
  ks_sync submit(const ComputeRequest& request);
  void wait(const ks_sync& sync);
  /// The semaphore of submit()'s values, as an fd of the caller's; KS_ERROR_UNSUPPORTED where there is none.
  [[nodiscard]] ks_sync export_timeline();
  [[nodiscard]] const std::vector<ks_stage_time>& stage_times() const { return clock_.times(); }

 private:
  [[nodiscard]] ImageShape output_shape(uint32_t output) const;
  /// Bit k: KS_FORMAT_ k is possible.
  [[nodiscard]] uint32_t output_formats(uint32_t output) const;
  /// Whether the matcher sees 16-bit images.
  [[nodiscard]] bool is_wide() const { return imagers_[0].is_wide() || imagers_[1].is_wide(); }
  [[nodiscard]] Region region(const simsense_parameters& parameters) const;
  /// What the matcher is given to find a region's disparities.
  [[nodiscard]] Region reach(const Region& region) const;
  /// Checks all of a call's images and makes them reachable; open(argument, shape, name) gives an image of the frame.
  template <class FrameType, class Open>
  void open_frame(const ComputeRequest& request, FrameType& frame, const Open& open) const;
  void check_output(const ComputeRequest::Output& wanted, bool listed_before, bool has_rgb_image) const;
  [[nodiscard]] bool use_vulkan(const simsense_parameters& parameters) const;
  [[nodiscard]] bool refuse_vulkan(const std::string& why_not) const;
  void compute_on_host(const ComputeRequest& request);
  uint64_t submit_to_device(const ComputeRequest& request);
  void wait_for_device(uint64_t submission);
  ConstImage prepare_eye(Frame& frame, uint32_t batch_index, uint32_t eye);
  ConstImage measure_eye(Frame& frame, uint32_t batch_index, uint32_t eye);
  ConstImage measure_wide(Frame& frame, uint32_t batch_index, uint32_t eye);
  ConstImage widened(ConstImage image, uint32_t eye);
  [[nodiscard]] NoiseKey noise_key(uint32_t batch_index, uint32_t eye) const;
  void match(ConstImage left, ConstImage right, const MatchMaps& maps, const std::function<void(float)>& tell);
  void match_region(ConstImage left, ConstImage right, const Region& region, const MatchMaps& maps);
  MatchMaps open_maps(Frame& frame, uint32_t batch_index);
  void finish_pair(Frame& frame, uint32_t batch_index, const MatchMaps& maps);
  void clean(const MatchMaps& maps);
  void make_depth(Frame& frame, uint32_t batch_index, const float* disparity);
  void explain(Frame& frame, uint32_t batch_index, ConstImage left, const MatchMaps& maps);
  void make_registered(Frame& frame, uint32_t batch_index, const float* disparity);

  std::shared_ptr<ks::Device> device_;
  ks::ThreadPool& workers_;
  simsense_rig_desc rig_;
  simsense_parameters parameters_;
  Imager imagers_[2];
  Rectification rectification_;
  uint32_t width_, height_;
  bool has_rgb_;
  std::optional<Registration> registration_;
  PointMaker points_;
  bool on_device_ = false;  // else matcher_ works, pair by pair
  std::unique_ptr<Matcher> matcher_;
  std::unique_ptr<VulkanPipeline> pipeline_;
  StageClock clock_;
  SpeckleFilter speckle_filter_;
  std::vector<uint8_t> counts_[2], rectified_[2], reason_, region_reason_;
  std::vector<uint16_t> wide_counts_[2], wide_rectified_[2];
  std::vector<float> disparity_, confidence_, depth_, depth_rgb_, region_disparity_, region_confidence_;
};

}  // namespace simsense
