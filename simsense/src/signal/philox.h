// SPDX-License-Identifier: Apache-2.0
// Philox4x32-10, a counter-based random generator (Salmon, Moraes, Dror, Shaw: Parallel random numbers: as easy as 1, 2, 3. SC 2011).
// A block is a pure function of counter and key, so any pixel can be drawn by any thread in any order.
#pragma once

#include <array>
#include <cstdint>

namespace simsense {

using PhiloxBlock = std::array<uint32_t, 4>;
using PhiloxKey = std::array<uint32_t, 2>;

struct PhiloxConstants {
  static constexpr uint32_t multiplier0 = 0xD2511F53u, multiplier1 = 0xCD9E8D57u;
  static constexpr uint32_t weyl0 = 0x9E3779B9u, weyl1 = 0xBB67AE85u;
  static constexpr int rounds = 10;
};

inline PhiloxBlock philox(PhiloxBlock counter, PhiloxKey key) {
  using C = PhiloxConstants;
  for (int round = 0; round < C::rounds; ++round) {
    const uint64_t product0 = uint64_t{C::multiplier0} * counter[0], product1 = uint64_t{C::multiplier1} * counter[2];
    counter = {static_cast<uint32_t>(product1 >> 32) ^ counter[1] ^ key[0], static_cast<uint32_t>(product1),
               static_cast<uint32_t>(product0 >> 32) ^ counter[3] ^ key[1], static_cast<uint32_t>(product0)};
    key[0] += C::weyl0;
    key[1] += C::weyl1;
  }
  return counter;
}

}  // namespace simsense
