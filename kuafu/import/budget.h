// SPDX-License-Identifier: Apache-2.0
// The memory that reading one scene file may take. It is proportional to the files' bytes, so that a short file cannot ask for gigabytes. A
// reader claims memory before it allocates by a number in a file, which gives clear errors. Other allocations, inside libraries, meet the
// process' address space limit, kept at the same number. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>

namespace kuafu {

class Budget {
 public:
  /// A budget without a limit, for tests.
  Budget() = default;
  /// Limits claims to bytes, which files may raise to most_bytes; limits the process' address space by the same.
  Budget(uint64_t bytes, uint64_t most_bytes);

  /// Limits claims but not the process, for tests.
  void limit_claims(uint64_t bytes) { limit_ = most_ = bytes; }
  /// Raises the limit for a file of this size, by memory_per_file_byte (io/load.h).
  void add_file(uint64_t file_bytes);
  /// Claims memory for `what`. Throws KS_ERROR_FILE with its name if all claims together exceed the limit.
  void claim(uint64_t bytes, const std::string& what);
  [[nodiscard]] uint64_t limit_bytes() const { return limit_; }

 private:
  void limit_address_space() const;

  uint64_t limit_ = UINT64_MAX, most_ = UINT64_MAX, claimed_ = 0;
  uint64_t own_bytes_ = 0;  // of the process before it read anything
};

}  // namespace kuafu
