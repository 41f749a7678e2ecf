#include "cpu/sgm.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cpu/sgm.cpp"
#include "cpu/targets.h"
// after targets.h
#include "cpu/sgm-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

template <class Cost>
Aggregation* create(const CensusPlanes& left, const CensusPlanes& right, size_t width, size_t height, const MatchParameters& p,
                    size_t threads) {
  return new Sgm<Cost>(left, right, width, height, p, threads);
}

Aggregation* create_aggregation(const CensusPlanes& left, const CensusPlanes& right, size_t width, size_t height, const MatchParameters& p,
                                size_t threads) {
  const size_t area = size_t{p.block_width} * p.block_height;
  const bool bytes = area == 1 && 2 * p.p2 <= 255 && p.max_disparity <= 256;  // two paths and an index fit 8 bit
  const bool words = 4 * p.p2 * area <= 65535;                                // four paths fit 16 bit
  const auto engine = bytes ? (left.plane_count() == 3 ? create<HammingCost<3>> : create<HammingCost<4>>)
                            : (words ? create<BlockCost<uint16_t>> : create<BlockCost<uint32_t>>);
  return engine(left, right, width, height, p, threads);
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace simsense::cpu {

HWY_EXPORT(create_aggregation);

size_t left_reach(const MatchParameters& parameters) { return parameters.max_disparity + parameters.block_width / 2; }

std::unique_ptr<Aggregation> make_aggregation(const CensusPlanes& left, const CensusPlanes& right, size_t width, size_t height,
                                              const MatchParameters& parameters, size_t threads) {
  return std::unique_ptr<Aggregation>(HWY_DYNAMIC_DISPATCH(create_aggregation)(left, right, width, height, parameters, threads));
}

}  // namespace simsense::cpu
#endif
