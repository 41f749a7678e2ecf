// SPDX-License-Identifier: Apache-2.0
// The handles that a sequence of calls made, live and released: what a call is given may be NULL, of another kind, or released.
#pragma once

#include <vector>

#include "bytes.h"

template <class Handle, void (*retain)(Handle), void (*release)(Handle)>
class Handles {
 public:
  ~Handles() {
    for (Owned& owned : all_)
      for (; owned.references > 0; --owned.references) release(owned.handle);
  }
  /// Where a create call puts its handle; keep() afterwards.
  Handle* out() { return &created_; }
  void keep() {
    if (created_ != nullptr) all_.push_back({created_, 1});
    created_ = nullptr;
  }
  Handle pick(Bytes& bytes, void* other_kind) {
    const uint8_t choice = bytes.byte();
    if (choice < 4) return nullptr;
    if (choice < 8) return reinterpret_cast<Handle>(other_kind);
    return all_.empty() ? nullptr : all_[choice % all_.size()].handle;
  }
  /// One of the live ones most likely: the latest.
  Handle latest() { return all_.empty() ? nullptr : all_.back().handle; }
  void retain_or_release(Bytes& bytes) {
    if (all_.empty()) return release(nullptr);
    Owned& owned = all_[bytes.byte() % all_.size()];
    if (bytes.below(2) == 0) {
      retain(owned.handle);
      owned.references += owned.references > 0;
    } else {
      release(owned.handle);  // once more than allowed, it is refused
      owned.references -= owned.references > 0;
    }
  }

 private:
  struct Owned {
    Handle handle;
    int references;
  };
  Handle created_ = nullptr;
  std::vector<Owned> all_;
};
