// SPDX-License-Identifier: Apache-2.0
#ifndef KS_HANDLE_HPP
#define KS_HANDLE_HPP
#include <stdexcept>
#include <string>
#include <utility>
#include "ks/status.h"
namespace ks {
class Error : public std::runtime_error {
 public:
  Error(ks_status status, const char* text) : std::runtime_error(std::string(ks_status_name(status)) + ": " + text), status_(status) {}
  [[nodiscard]] ks_status status() const noexcept { return status_; }
 private:
  ks_status status_;
};
template <class Handle, void (*retain)(Handle), void (*release)(Handle)>
class Reference {
 public:
  Reference() = default;
  explicit Reference(Handle handle) noexcept : handle_(handle) {}
  Reference(const Reference& other) noexcept : handle_(other.handle_) {
    if (handle_) retain(handle_);
  }
  Reference(Reference&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Reference& operator=(Reference other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Reference() { release(handle_); }
  [[nodiscard]] Handle get() const noexcept { return handle_; }
  operator Handle() const noexcept { return handle_; }
 protected:
  Handle handle_ = nullptr;
};
}
#endif
