// SPDX-License-Identifier: Apache-2.0
// Wall time of stages that the host runs, in order of first use. Thread rule: externally synchronised.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <vector>

#include "ks/log.h"

namespace simsense {

class HostClock {
 public:
  void reset() { times_.clear(); }
  [[nodiscard]] const std::vector<ks_stage_time>& times() const { return times_; }

  void add(const char* name, double milliseconds) {
    const auto same = [&](const ks_stage_time& t) { return std::strncmp(t.name, name, sizeof t.name) == 0; };
    const auto found = std::find_if(times_.begin(), times_.end(), same);
    if (found != times_.end()) {
      found->milliseconds += milliseconds;
      return;
    }
    ks_stage_time time{};
    std::snprintf(time.name, sizeof time.name, "%s", name);
    time.milliseconds = milliseconds;
    times_.push_back(time);
  }

  template <class F>
  void measure(const char* name, const F& stage) {
    const auto start = std::chrono::steady_clock::now();
    stage();
    add(name, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }

 private:
  std::vector<ks_stage_time> times_;
};

}  // namespace simsense
