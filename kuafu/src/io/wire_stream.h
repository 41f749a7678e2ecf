// SPDX-License-Identifier: Apache-2.0
// Writes and reads a helper program's answer (io/wire.h): numbers, arrays, texts and lists, in their form in memory.
#pragma once

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include "device/error.h"

namespace kuafu {

class Writer {
 public:
  explicit Writer(std::FILE* to) : to_(to) {}
  template <class T>
  void plain(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    bytes(&value, sizeof value);
  }
  template <class T>
  void array(const std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T>);
    plain(uint64_t{values.size()});
    bytes(values.data(), values.size() * sizeof(T));
  }
  void text(const std::string& value) {
    plain(uint64_t{value.size()});
    bytes(value.data(), value.size());
  }
  void flag(bool value) { plain(static_cast<uint8_t>(value)); }
  /// Writes a list; `each` writes one value.
  template <class T, class Each>
  void list(const std::vector<T>& values, Each&& each) {
    plain(uint64_t{values.size()});
    for (const T& value : values) each(value);
  }

 private:
  void bytes(const void* from, size_t size) {
    if (size > 0 && std::fwrite(from, size, 1, to_) != 1) ks::fail(KS_ERROR_FILE, "the answer cannot be written: %s", std::strerror(errno));
  }
  std::FILE* to_;
};

class Reader {
 public:
  Reader(const std::function<void(void*, size_t)>& read, uint64_t most_bytes) : read_(read), left_(most_bytes) {}
  template <class T>
  void plain(T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    read_(&value, sizeof value);
  }
  template <class T>
  void array(std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T>);
    values.resize(claim(sizeof(T)));
    read_(values.data(), values.size() * sizeof(T));
  }
  void text(std::string& value) {
    value.resize(claim(1));
    read_(value.data(), value.size());
  }
  void flag(bool& value) {
    uint8_t byte = 0;
    plain(byte);
    value = byte != 0;
  }
  template <class T, class Each>
  void list(std::vector<T>& values, Each&& each) {
    values.resize(claim(sizeof(T)));
    for (T& value : values) each(value);
  }
  /// Reads the count of the elements that follow, each of at least `element_bytes`, and takes their bytes off the limit.
  size_t claim(size_t element_bytes) {
    uint64_t count = 0;
    plain(count);
    if (count > left_ / element_bytes)
      ks::fail(KS_ERROR_FILE, "the scene in it takes more memory than a file of its size may: KUAFU_LOAD_MEMORY_MB allows more");
    left_ -= count * element_bytes;
    return count;
  }

 private:
  const std::function<void(void*, size_t)>& read_;
  uint64_t left_;
};

}  // namespace kuafu
