// SPDX-License-Identifier: Apache-2.0
// Looking entries up in a scene's tables; messages have the ids that callers count from 1; what is not there, or was removed, is an error
// that says so. Thread rule: pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "device/error.h"

namespace kuafu {

/// `owner` 'name' refers to entry `id`, whose table keeps removed ones with `removed` set.
template <class T>
void check_exists(const char* owner, const std::string& name, const char* kind, uint32_t id, const std::vector<T>& table) {
  if (id >= table.size())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s '%s': there is no %s %u (the scene has %zu)", owner, name.c_str(), kind, id + 1, table.size());
  if (table[id].removed) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s '%s': %s %u was removed", owner, name.c_str(), kind, id + 1);
}

template <class Table>
auto& there(Table& table, const char* kind, uint32_t id) {
  if (id >= table.size()) ks::fail(KS_ERROR_INVALID_ARGUMENT, "there is no %s %u (the scene has %zu)", kind, id + 1, table.size());
  if (table[id].removed) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s %u was removed", kind, id + 1);
  return table[id];
}

template <class T>
T& live(std::vector<std::optional<T>>& table, const char* kind, uint32_t id) {
  if (id >= table.size()) ks::fail(KS_ERROR_INVALID_ARGUMENT, "there is no %s %u (ids go to %zu)", kind, id + 1, table.size());
  if (!table[id]) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s %u was removed", kind, id + 1);
  return *table[id];
}

}  // namespace kuafu
