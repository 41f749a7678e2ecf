// SPDX-License-Identifier: Apache-2.0
// Bytes as the answer of a helper program that was taken over: a scene that passes the checks, or one error.
#include <cstring>

#include "device/error.h"
#include "io/wire.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  size_t at = 0;
  const auto read = [&](void* to, size_t bytes) {
    if (bytes > size - at) ks::fail(KS_ERROR_FILE, "the end");
    if (bytes > 0) std::memcpy(to, data + at, bytes);
    at += bytes;
  };
  try {
    kuafu::ImportAnswer answer = kuafu::read_answer(read, 64 << 20);
    (void)answer.scene.bounds();
    answer.scene.animate(kuafu::none, 0.5);
  } catch (const ks::Error&) {
  }
  return 0;
}
