// SPDX-License-Identifier: Apache-2.0
// A call of an extern "C" function, and the object behind a C handle: a shared_ptr, a reference count and a tag, which tells kinds of
// handles and released handles apart. Thread rule: retain and release may be called from any thread.
#pragma once

#include <cxxabi.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <utility>

#include "device/cancellation.h"
#include "device/error.h"

namespace ks {

/// Memory of handles: fixed blocks that are never given back to the allocator and are used again late, so that a caller who uses a handle
/// after its last release meets its erased tag, not foreign memory. Any thread may ask for one, also after fork.
inline constexpr size_t handle_memory_bytes = 64;
/// Blocks that wait at least: a handle is recognised as released until so many others were released.
inline constexpr size_t handles_remembered = 1024;

/// Allocates a block of handle_memory_bytes. Throws std::bad_alloc.
void* take_handle_memory();
void give_handle_memory(void* block) noexcept;

/// Works as guard(), but lets the unwinding of a thread pass that ends inside (pthread_cancel, or pthread_exit in a callback). To catch it
/// would end the process. The sanitizer is off here because that exception is caught as a reference to nothing.
template <class F>
__attribute__((no_sanitize("undefined"))) ks_status call(F&& fn) {
  const CancellationHeld held;
  try {
    std::forward<F>(fn)();
    return KS_OK;
  } catch (abi::__forced_unwind&) {
    throw;
  } catch (...) {
    return guard([] { throw; });
  }
}

/// Base of kuafu_device_t and the other handles. tag_value differs for every kind of handle in both libraries. After a fork, the child has
/// no threads of ours or of the driver: it refuses handles, and their release does nothing. `without_threads`: a handle that is plain
/// memory, and still works there.
template <class Object, uint32_t tag_value, bool without_threads = false>
struct Handle {
  explicit Handle(std::shared_ptr<Object> shared) : object(std::move(shared)) {}
  static constexpr uint32_t expected_tag = tag_value;
  std::atomic<uint32_t> tag{tag_value};
  std::atomic<uint32_t> references{1};
  std::atomic<bool> in_call{false};
  std::shared_ptr<Object> object;
  const pid_t process = getpid();
  [[nodiscard]] bool forked() const { return process != getpid(); }
  static constexpr bool works_after_fork = without_threads;
  static void* operator new(size_t size_bytes) {
    if (size_bytes > handle_memory_bytes) throw std::bad_alloc();
    return take_handle_memory();
  }
  static void operator delete(void* memory) { give_handle_memory(memory); }
};

/// Returns the object behind a handle. Recognises a released handle until handles_remembered others were released.
template <class H>
const auto& object_of(H* handle, const char* name) {
  if (handle == nullptr) fail(KS_ERROR_INVALID_ARGUMENT, "%s is NULL", name);
  if (handle->tag.load(std::memory_order_acquire) != H::expected_tag)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s is no such handle of this library, or was released", name);
  if constexpr (!H::works_after_fork)
    if (handle->forked()) fail(KS_ERROR_INVALID_STATE, "%s was made before fork: a child process makes a device of its own", name);
  return handle->object;
}

/// Gives one call at a time access to the object behind a handle; a second call, by another thread or a callback, is refused. The object
/// lives as long as this, even if another thread releases the handle.
template <class H>
class Exclusive {
 public:
  Exclusive(H* handle, const char* name) : object_(object_of(handle, name)), handle_(handle) {
    if (handle->in_call.exchange(true, std::memory_order_acquire))
      fail(KS_ERROR_INVALID_STATE, "this %s is inside another call: use it from one thread at a time", name);
  }
  Exclusive(const Exclusive&) = delete;
  Exclusive& operator=(const Exclusive&) = delete;
  ~Exclusive() { handle_->in_call.store(false, std::memory_order_release); }
  auto* operator->() const { return object_.get(); }
  auto& operator*() const { return *object_; }
  const auto& shared() const { return object_; }

 private:
  decltype(H::object) object_;
  H* handle_;  // its memory outlives it (take_handle_memory)
};

template <class H>
void retain(H* handle, const char* name) noexcept {
  (void)call([&] {
    (void)object_of(handle, name);
    handle->references.fetch_add(1, std::memory_order_relaxed);
  });
}

/// Releases a reference; NULL is allowed.
template <class H>
void release(H* handle, const char* name) noexcept {
  if (handle == nullptr || (handle->tag.load(std::memory_order_acquire) == H::expected_tag && handle->forked())) return;
  (void)call([&] {
    (void)object_of(handle, name);
    if (handle->references.fetch_sub(1, std::memory_order_acq_rel) != 1) return;
    handle->tag.store(0, std::memory_order_release);
    delete handle;
  });
}

/// Sets the output of a create call to NULL until it succeeds.
template <class T>
void clear_out(T** out) {
  if (out == nullptr) fail(KS_ERROR_INVALID_ARGUMENT, "out is NULL");
  *out = nullptr;
}

}  // namespace ks
