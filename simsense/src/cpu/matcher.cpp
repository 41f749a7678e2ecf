#include "matcher.h"

namespace simsense {

std::unique_ptr<Matcher> make_cpu_matcher(uint32_t width, uint32_t height, const MatchParameters& parameters, ks::ThreadPool&) {
  return make_reference_matcher(width, height, parameters);
}

}  // namespace simsense
