// SPDX-License-Identifier: Apache-2.0
// The entries of a table that changed since a revision that a reader remembers; the cost of following them depends on their number alone.
// Thread rule: externally synchronised.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace kuafu {

class ChangeLog {
 public:
  [[nodiscard]] uint64_t revision() const { return base_ + entries_.size(); }

  void note(uint32_t entry) {
    if (entries_.size() >= most_entries) base_ = revision(), entries_.clear();
    entries_.push_back(entry);
  }

  /// Returns the entries that changed after `revision`, in order, perhaps twice. Nothing if that is too long ago: read all entries.
  [[nodiscard]] std::optional<std::span<const uint32_t>> since(uint64_t revision) const {
    if (revision < base_ || revision > this->revision()) return std::nullopt;
    return std::span(entries_).subspan(revision - base_);
  }

 private:
  static constexpr size_t most_entries = 1u << 16;
  uint64_t base_ = 1;  // revision before entries_[0]
  std::vector<uint32_t> entries_;
};

}  // namespace kuafu
