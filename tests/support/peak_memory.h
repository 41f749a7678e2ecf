// SPDX-License-Identifier: Apache-2.0
// Most memory and time that a piece of work takes: in a forked child, so that neither what ran before nor what it leaves counts.
#pragma once

#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstring>

namespace ks_test {

struct Peak {
  bool ok = false;  // else the work failed, or the system does not tell
  double megabytes = 0, milliseconds = 0;
};

/// A line of /proc/self/status in bytes; 0 where there is none.
inline double status_bytes(const char* key) {
  std::FILE* file = std::fopen("/proc/self/status", "r");
  if (!file) return 0;
  char line[256];
  double kilobytes = 0;
  while (std::fgets(line, sizeof line, file))
    if (std::strncmp(line, key, std::strlen(key)) == 0) std::sscanf(line + std::strlen(key), ": %lf", &kilobytes);
  std::fclose(file);
  return kilobytes * 1024;
}

/// Growth of the resident memory, 10^6 bytes, from before `work` to its highest. A child's high-water mark starts at what it has.
template <class F>
Peak peak_of(F&& work) {
  int ends[2];
  Peak peak;
  if (pipe(ends) != 0) return peak;
  malloc_trim(0);
  const pid_t child = fork();
  if (child == 0) {
    const double before = status_bytes("VmRSS");
    const auto start = std::chrono::steady_clock::now();
    work();
    peak.milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    const double highest = status_bytes("VmHWM");
    peak.ok = before > 0 && highest > 0;
    peak.megabytes = (highest - before) / 1e6;
    _exit(write(ends[1], &peak, sizeof peak) == sizeof peak ? 0 : 1);
  }
  close(ends[1]);
  if (child < 0 || read(ends[0], &peak, sizeof peak) != sizeof peak) peak = {};
  close(ends[0]);
  if (child > 0) waitpid(child, nullptr, 0);
  return peak;
}

}  // namespace ks_test
