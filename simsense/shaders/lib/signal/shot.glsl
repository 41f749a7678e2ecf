// SPDX-License-Identifier: Apache-2.0
// Shot noise: the Poisson quantile of the mean charge at the pixel's uniform number, by the formulas of cpu/signal/shot-inl.h.
#ifndef SIMSENSE_SIGNAL_SHOT_GLSL
#define SIMSENSE_SIGNAL_SHOT_GLSL
#include "lib/signal/math.glsl"

const float poisson_sum_below_e = 10.0f;

/// Normal asymptotic expansion of the quantile (Giles, Algorithm 955, ACM TOMS 42(1), 2016).
vec4 poisson_expansion(vec4 mean, vec4 z) {
  vec4 bounded = max(mean, poisson_sum_below_e), z2 = z * z, root = sqrt(bounded);
  vec4 order0 = z2 / 6.0f + 1.0f / 3.0f;
  vec4 order1 = z * (z2 / -72.0f - 1.0f / 36.0f);
  vec4 order2 = (z2 / 270.0f + 7.0f / 810.0f) * z2 - 8.0f / 405.0f;
  return floor(bounded + (root * z + (order0 + (order1 + order2 / root) / root)));
}

/// The least n whose cumulated probability reaches the uniform number; terms below 1e-9 end the sum.
vec4 poisson_sum(vec4 mean, Uniform u) {
  vec4 target = mix(0.5f + u.centre, u.tail, u.low);
  vec4 term = exponential(-mean), sum = term, n = vec4(0.0f);
  for (float next = 1.0f; next < 200.0f; ++next) {
    bvec4 open;
    [[unroll]] for (uint i = 0u; i < 4u; ++i) open[i] = target[i] > sum[i] && term[i] > 1e-9f;
    if (!any(open)) break;
    n = mix(n, vec4(next), open);
    term *= mean / next;
    sum += term;
  }
  return n;
}

/// No electrons, no noise.
vec4 poisson_of(vec4 mean, uvec4 words) {
  Uniform u = uniform_of(words);
  bvec4 positive = greaterThan(mean, vec4(0.0f)), below = lessThan(mean, vec4(poisson_sum_below_e));
  bvec4 few = bvec4(positive.x && below.x, positive.y && below.y, positive.z && below.z, positive.w && below.w);
  vec4 count = poisson_expansion(mean, normal_of(u));
  if (any(few)) count = mix(count, poisson_sum(mix(vec4(0.0f), mean, few), u), few);
  return mix(mean, count, positive);
}
#endif
