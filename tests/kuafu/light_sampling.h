// SPDX-License-Identifier: Apache-2.0
// Whether light that samples of lamps find and light that samples of the BSDF find are one light.
#pragma once

#include "kuafu/world.h"

namespace laws {

/// A lamp behind something that scatters what it lets through: every way of sampling gives the same mean.
inline void expect_samplings_agree_through(const Shape& glass, const kuafu_material_desc& material, uint32_t samples, uint32_t bounces) {
  double means[3];
  for (const uint32_t sampling : {KUAFU_SAMPLING_MIS, KUAFU_SAMPLING_LIGHTS, KUAFU_SAMPLING_BSDF}) {
    World world;
    world.add(glass, material, placed({0, 0, 1}, 0.3));
    world.add(quad({0, 0, 2}, {-0.3, 0, 0}, {0, 0.3, 0}), emitter(1.0f));
    world.desc().samples_per_pixel = samples;
    world.desc().max_bounces = bounces;
    world.desc().light_sampling = sampling;
    means[sampling] = world.radiance(view_at({0, 0, 0}, 6, 6, 40)).mean();
  }
  EXPECT_NEAR(means[KUAFU_SAMPLING_LIGHTS] / means[KUAFU_SAMPLING_MIS], 1, 0.02);
  EXPECT_NEAR(means[KUAFU_SAMPLING_BSDF] / means[KUAFU_SAMPLING_MIS], 1, 0.02);
}

}  // namespace laws
