// SPDX-License-Identifier: Apache-2.0
// One kind of a scene's objects, by id. Looking up a missing or removed one is an error with the ids, which callers count from 1. Thread
// rule: externally synchronised.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "device/error.h"

namespace kuafu {

inline constexpr uint32_t none = 0xffffffffu;

/// A table of entries by id. An id is never given again, so a removed entry's id finds nothing. Its slot is used again: memory follows the
/// present entries, plus four bytes per id.
template <class T>
class Table {
 public:
  /// Adds an entry and returns its id.
  uint32_t add(T entry) {
    make_room(1);
    const auto id = uint32_t(slots_.size());
    if (free_.empty()) {
      free_.push_back(uint32_t(entries_.size()));
      entries_.emplace_back();
      ids_.push_back(none);
    }
    const uint32_t slot = free_.back();
    free_.pop_back();
    entries_[slot] = std::move(entry);
    ids_[slot] = id;
    slots_.push_back(slot);
    return id;
  }
  void remove(uint32_t id) {
    const uint32_t slot = std::exchange(slots_[id], none);
    entries_[slot].reset();
    ids_[slot] = none;
    free_.push_back(slot);
  }
  /// Moves the entries of `other` here; their ids grow by the former ids_given(). Does not fail if there is room.
  void append(Table&& other) {
    for (const uint32_t slot : other.slots_) {
      if (slot == none)
        slots_.push_back(none);
      else
        add(std::move(*other.entries_[slot]));
    }
    other = {};
  }
  /// Allocates memory for `count` more ids.
  void make_room(size_t count) {
    if (ids_given() + count > none) ks::fail(KS_ERROR_UNSUPPORTED, "a scene table is full (2^32 - 1 ids)");
    const auto grow = [count](auto& to) {
      if (to.capacity() < to.size() + count) to.reserve(std::max(2 * to.size(), to.size() + count));
    };
    grow(slots_), grow(entries_), grow(ids_);
    free_.reserve(ids_.capacity());
  }

  [[nodiscard]] bool has(uint32_t id) const { return id < slots_.size() && slots_[id] != none; }
  [[nodiscard]] T& operator[](uint32_t id) { return *entries_[slots_[id]]; }
  [[nodiscard]] const T& operator[](uint32_t id) const { return *entries_[slots_[id]]; }
  /// The entry's slot: its place in tables of all present entries.
  [[nodiscard]] uint32_t slot(uint32_t id) const { return slots_[id]; }
  /// Maps a slot to its id, or none if it is free.
  [[nodiscard]] const std::vector<uint32_t>& ids() const { return ids_; }
  [[nodiscard]] size_t ids_given() const { return slots_.size(); }
  [[nodiscard]] size_t size() const { return ids_.size() - free_.size(); }
  [[nodiscard]] bool empty() const { return size() == 0; }
  // By slot; free ones are empty.
  [[nodiscard]] auto begin() { return entries_.begin(); }
  [[nodiscard]] auto end() { return entries_.end(); }
  [[nodiscard]] auto begin() const { return entries_.begin(); }
  [[nodiscard]] auto end() const { return entries_.end(); }

 private:
  std::vector<uint32_t> slots_;  // by id; none: removed
  std::vector<std::optional<T>> entries_;
  std::vector<uint32_t> ids_, free_;
};

template <class T>
uint32_t slot_or_none(const Table<T>& table, uint32_t id) {
  return id == none ? none : table.slot(id);
}

/// Throws unless the entry that `owner` 'name' refers to exists.
template <class T>
void check_exists(const char* owner, const std::string& name, const char* kind, uint32_t id, const Table<T>& table) {
  if (id >= table.ids_given())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s '%s': there is no %s %u (the scene has %zu)", owner, name.c_str(), kind, id + 1, table.size());
  if (!table.has(id)) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s '%s': %s %u was removed", owner, name.c_str(), kind, id + 1);
}

template <class AnyTable>
auto& there(AnyTable& table, const char* kind, uint32_t id) {
  if (id >= table.ids_given()) ks::fail(KS_ERROR_INVALID_ARGUMENT, "there is no %s %u (the scene has %zu)", kind, id + 1, table.size());
  if (!table.has(id)) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s %u was removed", kind, id + 1);
  return table[id];
}

/// The entries of a table that changed since a revision that a reader remembers; the cost of following them depends on their number alone.
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
