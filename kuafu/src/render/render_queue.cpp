// SPDX-License-Identifier: Apache-2.0
#include "render/render_queue.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "device/cancellation.h"
#include "device/error.h"
#include "device/spare_threads.h"

namespace kuafu {

RenderQueue::RenderQueue(const std::shared_ptr<ks::Device>& device, TracerKind tracer, std::string oidn_library)
    : renderer_(device, tracer, std::move(oidn_library)) {}

RenderQueue::~RenderQueue() {
  cancel();
  std::unique_lock lock(mutex_);
  stopping_ = true;
  changed_.notify_all();
  changed_.wait(lock, [&] { return !serving_; });
}

void RenderQueue::heed_cancel(Launch& launch) const {
  launch.cancelled = [this, before = wishes_.load(), ask = std::move(launch.cancelled)](float fraction) {
    return wishes_ != before || (ask && ask(fraction));
  };
}

void RenderQueue::render(const Scene& scene, Launch launch) {
  heed_cancel(launch);
  (void)wait_for_ended(submitted_, UINT64_MAX);
  renderer_.render(scene, launch);
  stage_times_ = renderer_.stage_times();
  summary_ = renderer_.summary();
}

void RenderQueue::light(const Scene& scene, const GbufferLaunch& gbuffers) {
  (void)wait_for_ended(submitted_, UINT64_MAX);
  renderer_.light(scene, gbuffers);
  stage_times_ = renderer_.stage_times();
}

uint64_t RenderQueue::submit(std::shared_ptr<const Scene> scene, Launch launch, std::shared_ptr<const void> held) {
  heed_cancel(launch);
  const uint64_t number = submitted_ + 1;
  if (number > most_under_way) (void)wait_for_ended(number - most_under_way, UINT64_MAX);
  {
    const std::lock_guard lock(mutex_);
    if (!serving_) device()->spare_threads().run([this] { serve(); });
    serving_ = true;
    slot(number) = {std::move(scene), std::move(launch), std::move(held), nullptr, {}, {}};
    submitted_ = number;
  }
  changed_.notify_all();
  return number;
}

bool RenderQueue::wait(uint64_t number, uint64_t timeout_ns) {
  if (number == 0 || number > submitted_ || number + most_under_way <= submitted_)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "there is no submission %llu to wait for: %llu were made, and the last %llu are kept",
             static_cast<unsigned long long>(number), static_cast<unsigned long long>(submitted_),
             static_cast<unsigned long long>(most_under_way));
  if (!wait_for_ended(number, timeout_ns)) return false;
  const Submission& outcome = slot(number);
  if (outcome.failure) std::rethrow_exception(outcome.failure);
  stage_times_ = outcome.stage_times;
  summary_ = outcome.summary;
  return true;
}

bool RenderQueue::wait_for_ended(uint64_t count, uint64_t timeout_ns) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds slice(50);  // then a caller's thread that was cancelled may leave
  const auto longest = std::chrono::nanoseconds(std::min<uint64_t>(timeout_ns, INT64_MAX / 4));
  const Clock::time_point end = Clock::now() + longest;
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      if (changed_.wait_until(lock, std::min(end, Clock::now() + slice), [&] { return ended_ >= count; })) return true;
    }
    if (Clock::now() >= end) return false;
    ks::cancellation_point();
  }
}

ks_sync RenderQueue::export_timeline() {
  const std::lock_guard lock(mutex_);
  if (!timeline_) {
    timeline_.emplace(device());
    signal_ended();
  }
  return timeline_->exported(submitted_);
}

void RenderQueue::signal_ended() noexcept {
  if (!timeline_ || ended_ == 0) return;
  try {
    timeline_->signal(ended_);
  } catch (const ks::Error&) {
    // The device is lost, as every later call on it will say.
  }
}

void RenderQueue::serve() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return stopping_ || ended_ < submitted_; });
    if (ended_ == submitted_) break;  // what was submitted ends first: cancelled
    Submission& next = slot(ended_ + 1);
    lock.unlock();
    run(next);
    lock.lock();
    ++ended_;
    signal_ended();
    changed_.notify_all();
  }
  serving_ = false;
  changed_.notify_all();
}

void RenderQueue::run(Submission& submission) {
  try {
    renderer_.render(*submission.scene, submission.launch);
    submission.stage_times = renderer_.stage_times();
    submission.summary = renderer_.summary();
  } catch (...) {
    submission.failure = std::current_exception();
  }
  submission.launch = {};
  submission.scene.reset();
  submission.held.reset();
}

}  // namespace kuafu
