// SPDX-License-Identifier: Apache-2.0
// The clear coat: Fresnel's reflectance of index 1.5 over what lies below, no loss over white surfaces. In compute:
// lobes_law_test.cpp.
#include "kuafu/material/fresnel.h"
#include "kuafu/material/measured.h"

namespace laws {
namespace {

kuafu_material_desc coated(kuafu_material_desc m, float weight, float roughness) {
  m.clearcoat = weight;
  m.clearcoat_roughness = roughness;
  return m;
}

kuafu_material_desc white_metal(float roughness) {
  kuafu_material_desc m = lambert(1);
  m.metallic = 1;
  m.roughness = roughness;
  return m;
}

TEST(Clearcoat, over_black_reflects_what_fresnel_says) {
  for (const float weight : {1.0f, 0.4f})
    for (const double angle : {0.0, 0.8, 1.3})
      EXPECT_NEAR(in_furnace(coated(lambert(0), weight, 0), angle, 128).mean(), weight * reflectance(angle, 1.5), 2e-3)
          << weight << " " << angle;
  EXPECT_LT(in_furnace(coated(lambert(0), 1, 1), 1.3, 128).mean(), 0.7 * reflectance(1.3, 1.5)) << "facets of all tilts";
}

TEST(Clearcoat, over_white_loses_nothing) {
  for (const double angle : {0.2, 1.1}) {
    EXPECT_NEAR(in_furnace(coated(lambert(1), 1, 0.3f), angle, 128).mean(), 1, 0.01) << angle;
    EXPECT_NEAR(in_furnace(coated(white_metal(0), 1, 0), angle, 128).mean(), 1, 0.01) << angle;
  }
}

TEST(Clearcoat, over_glass_is_not_there) {
  const auto seen = [](float weight) {
    World world;
    world.add(box({5, 5, 0.1}), coated(glass(1.5f), weight, 0), placed({0, 0, 1}, 0.5));
    world.add(quad({0, 0, 3}, {-4, 0, 0}, {0, 4, 0}), emitter(1.0f));
    world.desc().samples_per_pixel = 64;
    return world.radiance(view_at({0, 0, 0}, 8, 8, 4000)).mean();
  };
  EXPECT_DOUBLE_EQ(seen(1), seen(0));
}

TEST(Clearcoat, that_is_rough_is_lit_by_a_lamp) {
  World world;
  world.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), coated(lambert(0), 1, 0.5f));
  world.add_point({0, 0, 0}, 1);
  world.desc().samples_per_pixel = 4;
  const double half = 0.0625;  // alpha squared: at the mirrored direction the distribution is 1 / (pi alpha^2), and nothing is masked
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 4, 4, 20000)).mean(), 0.04 / (4 * pi * half), 2e-3);
}

}  // namespace
}  // namespace laws
