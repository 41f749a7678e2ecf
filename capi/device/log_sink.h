// SPDX-License-Identifier: Apache-2.0
// Where a device's messages go: the host's callback, called by one thread at a time.
#pragma once

#include <mutex>

#include "ks/log.h"

namespace ks {

class LogSink {
 public:
  LogSink(ks_log_fn function, void* user) : function_(function), user_(user) {}
  [[nodiscard]] bool wanted() const { return function_ != nullptr; }
  void write(uint32_t level, const char* text) {
    if (function_ == nullptr) return;
    std::lock_guard lock(mutex_);
    function_(user_, level, text);
  }

 private:
  ks_log_fn function_;
  void* user_;
  std::mutex mutex_;
};

}  // namespace ks
