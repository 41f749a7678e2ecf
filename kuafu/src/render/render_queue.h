// SPDX-License-Identifier: Apache-2.0
// Renders whose caller does not wait for them: a thread of the device's takes them one after the other; at most two are under way.
// Thread rule: as the renderer's, one caller at a time; cancel() may be called by any thread at any time.
#pragma once

#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>

#include "device/timeline.h"
#include "render/renderer.h"

namespace kuafu {

class RenderQueue {
 public:
  /// Takes Renderer's arguments.
  RenderQueue(const std::shared_ptr<ks::Device>& device, TracerKind tracer, std::string oidn_library);
  /// Cancels the renders under way and waits for them.
  ~RenderQueue();
  RenderQueue(const RenderQueue&) = delete;
  RenderQueue& operator=(const RenderQueue&) = delete;

  /// Waits for submitted renders, then renders in the caller's thread.
  void render(const Scene& scene, Launch launch);
  /// Works as render() for surfaces that another renderer saw.
  void light(const Scene& scene, const GbufferLaunch& gbuffers);
  /// Returns the submission's number, as soon as fewer than two are under way. `held` is let go when the render has ended: until then the
  /// scene must stay as it is.
  uint64_t submit(std::shared_ptr<const Scene> scene, Launch launch, std::shared_ptr<const void> held);
  /// Returns false if the render has not ended after timeout_ns (UINT64_MAX: no timeout). Throws the render's error. An outcome is kept
  /// until the second submission after it.
  [[nodiscard]] bool wait(uint64_t number, uint64_t timeout_ns);
  /// The timeline, at the last submission's value. From the first call on, it reaches each submission's number when that render has ended.
  [[nodiscard]] ks_sync export_timeline();
  /// Ends every render that has begun or was submitted.
  void cancel() { ++wishes_; }

  /// Times of the last render that its caller waited for.
  [[nodiscard]] const std::vector<std::pair<std::string, double>>& stage_times() const { return stage_times_; }
  [[nodiscard]] const RenderSummary& summary() const { return summary_; }
  [[nodiscard]] const std::shared_ptr<ks::Device>& device() const { return renderer_.device(); }

 private:
  static constexpr uint64_t most_under_way = 2;
  struct Submission {
    std::shared_ptr<const Scene> scene;
    Launch launch;
    std::shared_ptr<const void> held;
    std::exception_ptr failure;
    std::vector<std::pair<std::string, double>> stage_times;
    RenderSummary summary;
  };

  [[nodiscard]] Submission& slot(uint64_t number) { return slots_[number % most_under_way]; }
  /// Makes cancel() end this launch, too.
  void heed_cancel(Launch& launch) const;
  /// Waits in the caller's thread until `count` submissions have ended. Returns false if the timeout ended first.
  [[nodiscard]] bool wait_for_ended(uint64_t count, uint64_t timeout_ns);
  void serve();
  void run(Submission& submission);
  /// Call under the mutex.
  void signal_ended() noexcept;

  Renderer renderer_;
  std::atomic<uint64_t> wishes_{0};
  std::mutex mutex_;
  std::condition_variable changed_;
  Submission slots_[most_under_way];
  uint64_t submitted_ = 0, ended_ = 0;    // how many
  std::optional<ks::Timeline> timeline_;  // where it was asked for
  bool serving_ = false;                  // from the first submission on
  bool stopping_ = false;
  std::vector<std::pair<std::string, double>> stage_times_;
  RenderSummary summary_{};
};

}  // namespace kuafu
