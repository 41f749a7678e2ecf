// SPDX-License-Identifier: Apache-2.0
// The uniform words of a row (signal/key.h) in vectors: one Philox block gives four neighbours their words.
#if defined(SIMSENSE_CPU_SIGNAL_WORDS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SIGNAL_WORDS_INL_H_
#undef SIMSENSE_CPU_SIGNAL_WORDS_INL_H_
#else
#define SIMSENSE_CPU_SIGNAL_WORDS_INL_H_
#endif

#include "cpu/signal/math-inl.h"
#include "signal/key.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

struct WideProduct {
  Words high, low;
};

HWY_INLINE WideProduct wide_product(Words a, uint32_t factor) {
#if HWY_TARGET == HWY_SCALAR
  const uint64_t product = uint64_t{hn::GetLane(a)} * factor;
  return {hn::Set(WordTag(), static_cast<uint32_t>(product >> 32)), hn::Set(WordTag(), static_cast<uint32_t>(product))};
#else
  const Words b = hn::Set(WordTag(), factor);
  const hn::Repartition<uint64_t, WordTag> wide;
  const auto even = hn::MulEven(a, b);
  const auto odd = hn::MulEven(hn::BitCast(WordTag(), hn::ShiftRight<32>(hn::BitCast(wide, a))), b);
  return {hn::OddEven(hn::BitCast(WordTag(), odd), hn::BitCast(WordTag(), hn::ShiftRight<32>(even))),
          hn::OddEven(hn::BitCast(WordTag(), hn::ShiftLeft<32>(odd)), hn::BitCast(WordTag(), even))};
#endif
}

/// Computes the random words of columns x0 .. x0 + count. x0: a multiple of 4, may be negative. count is rounded up to a multiple of 64.
HWY_INLINE void row_words(const PhiloxKey& key, Dimension dimension, int32_t x0, uint32_t y, size_t count, uint32_t* words) {
  using C = PhiloxConstants;
  const WordTag tag;
  const size_t lanes = hn::Lanes(tag);
  for (size_t x = 0; x < count; x += 4 * lanes) {
    const auto first_block = static_cast<uint32_t>((x0 + static_cast<int32_t>(x)) >> 2);
    Words c0 = hn::Iota(tag, first_block), c1 = hn::Set(tag, y);
    Words c2 = hn::Set(tag, static_cast<uint32_t>(dimension)), c3 = hn::Zero(tag);
    uint32_t key0 = key[0], key1 = key[1];
    for (int round = 0; round < C::rounds; ++round) {
      const WideProduct product0 = wide_product(c0, C::multiplier0), product1 = wide_product(c2, C::multiplier1);
      c0 = hn::Xor(hn::Xor(product1.high, c1), hn::Set(tag, key0));
      c2 = hn::Xor(hn::Xor(product0.high, c3), hn::Set(tag, key1));
      c1 = product1.low;
      c3 = product0.low;
      key0 += C::weyl0;
      key1 += C::weyl1;
    }
    hn::StoreInterleaved4(c0, c1, c2, c3, tag, words + x);
  }
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
