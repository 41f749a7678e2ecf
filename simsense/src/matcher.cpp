#include "matcher.h"

namespace simsense {

const char* MatchParameters::cpu_only() const {
  if (census != CensusKind::center_symmetric) return "census_kind";
  if (min_disparity != 0) return "min_disparity";
  if (path_count != 4) return "path_count";
  if (p2_full_gradient != 0) return "p2_full_gradient";
  if (subpixel == Subpixel::equiangular_summed) return "subpixel";
  return nullptr;
}

}  // namespace simsense
