// SPDX-License-Identifier: Apache-2.0
#include "device/interrupt.h"

#include <future>
#include <utility>

#include "device/cancellation.h"
#include "device/error.h"

namespace ks {
namespace {

thread_local Interrupt* current_interrupt = nullptr;

constexpr std::chrono::milliseconds between_questions(50);  // a callback may have to wait for its language's lock

}  // namespace

Interrupt::Interrupt(Ask ask) : ask_(std::move(ask)), before_(std::exchange(current_interrupt, this)) {}

Interrupt::~Interrupt() { current_interrupt = before_; }

Interrupt* Interrupt::current() { return current_interrupt; }

Interrupt::Adopted::Adopted(Interrupt* of) : before_(std::exchange(current_interrupt, of)) {}

Interrupt::Adopted::~Adopted() { current_interrupt = before_; }

void Interrupt::report(float fraction) {
  fraction_ = fraction;
  ask();
  if (requested()) leave();
}

void Interrupt::point() {
  ask_now_and_then();
  if (requested()) leave();
}

void Interrupt::ask_now_and_then() {
  if (std::this_thread::get_id() != caller_) return;
  if (std::chrono::steady_clock::now() - asked_ >= between_questions) ask();
}

void Interrupt::ask() {
  try {
    cancellation_point();
    if (ask_ && ask_(fraction_)) request();
  } catch (...) {  // also where the callback ends its thread
    request();
    throw;
  }
  asked_ = std::chrono::steady_clock::now();
}

void Interrupt::leave() const { fail(KS_ERROR_CANCELLED, "cancelled at %.0f %%", 100.0 * double(fraction_)); }

void Interrupt::watch(const std::function<void()>& fn) {
  Interrupt* const self = current();
  if (self == nullptr || std::this_thread::get_id() != self->caller_) return fn();
  if (!self->may_start_thread_) {
    const NoUnwinding barrier;
    return fn();
  }
  // Its destructor waits for the thread, whatever happens here.
  std::future<void> done = std::async(std::launch::async, [&] {
    const Adopted adopted(self);
    fn();
  });
  while (done.wait_for(between_questions) != std::future_status::ready) self->ask_now_and_then();
  done.get();
}

}  // namespace ks
