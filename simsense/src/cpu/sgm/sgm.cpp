// SPDX-License-Identifier: Apache-2.0
#include "cpu/sgm/sgm.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cpu/sgm/sgm.cpp"
#include "cpu/simd/targets.h"
// after targets.h
#include "cpu/sgm/sgm-inl.h"
#include "cpu/sgm/sgm8-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

template <class Engine>
Aggregation* create(const CensusPlanes& left, const CensusPlanes& right, const PenaltyMaps& maps, size_t width, size_t height,
                    const MatchParameters& p, size_t threads) {
  return new Engine(left, right, maps, width, height, p, threads);
}

Aggregation* create_aggregation(const CensusPlanes& left, const CensusPlanes& right, const PenaltyMaps& maps, size_t width, size_t height,
                                const MatchParameters& p, size_t threads) {
  const bool bytes = p.path_count == 4 && p.block_area() == 1 && 2 * p.p2 <= 255 && p.max_disparity <= 256;  // two paths, an index: 8 bit
  const bool words = p.path_count * p.p2 * p.block_area() <= 65535;                                          // all paths fit 16 bit
  const auto engine = [&] {
    if (p.path_count == 8) return words ? create<Sgm8<uint16_t>> : create<Sgm8<uint32_t>>;
    if (!bytes) return words ? create<Sgm<BlockCost<uint16_t>>> : create<Sgm<BlockCost<uint32_t>>>;
    switch (left.plane_count()) {
      case 3:
        return create<Sgm<HammingCost<3>>>;
      case 4:
        return create<Sgm<HammingCost<4>>>;
      case 6:
        return create<Sgm<HammingCost<6>>>;
      default:
        return create<Sgm<HammingCost<8>>>;
    }
  }();
  return engine(left, right, maps, width, height, p, threads);
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace simsense::cpu {

HWY_EXPORT(create_aggregation);

size_t left_reach(const MatchParameters& parameters) { return parameters.max_disparity + parameters.block_width / 2; }

std::unique_ptr<Aggregation> make_aggregation(const CensusPlanes& left, const CensusPlanes& right, const PenaltyMaps& maps, size_t width,
                                              size_t height, const MatchParameters& parameters, size_t threads) {
  return std::unique_ptr<Aggregation>(HWY_DYNAMIC_DISPATCH(create_aggregation)(left, right, maps, width, height, parameters, threads));
}

}  // namespace simsense::cpu
#endif
