// SPDX-License-Identifier: Apache-2.0
// Code that GCC has compiled with -fsanitize-coverage=trace-pc,trace-cmp tells libFuzzer which parts of it run.
#include <cstddef>
#include <cstdint>

namespace {

constexpr size_t places = 1 << 16;

/// libFuzzer finds counters of others by the section's name, and clears them before each input.
[[gnu::section("__libfuzzer_extra_counters"), gnu::used]] uint8_t counters[places];

}  // namespace

/// Called at the beginning of every basic block.
extern "C" __attribute__((no_sanitize_coverage, no_sanitize("address"))) void __sanitizer_cov_trace_pc() {
  uint8_t& counter = counters[(reinterpret_cast<uintptr_t>(__builtin_return_address(0)) >> 1) % places];
  if (counter < UINT8_MAX) ++counter;
}

/// Called where GCC's code compares numbers with fractions, which libFuzzer does nothing with and has no functions for.
extern "C" void __sanitizer_cov_trace_cmpf(float, float) {}
extern "C" void __sanitizer_cov_trace_cmpd(double, double) {}
