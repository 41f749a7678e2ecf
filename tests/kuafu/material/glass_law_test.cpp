// SPDX-License-Identifier: Apache-2.0
// Smooth glass against the closed forms of Fresnel and Snell.
#include "kuafu/material/fresnel.h"
#include "kuafu/world.h"

namespace laws {
namespace {

TEST(Glass, a_slab_transmits_what_fresnel_says) {
  // All internal reflections summed: T = (1 - R) / (1 + R).
  for (const double angle : {0.0, 0.5, 1.0, 1.3}) {
    World world;
    world.add(box({5, 5, 0.001}), glass(1.5f), placed({0, 0, 1}, angle));
    world.add(quad({0, 0, 20}, {-3, 0, 0}, {0, 3, 0}), emitter(1.0f));  // too small for what is reflected
    world.desc().samples_per_pixel = 256;
    world.desc().max_bounces = 40;
    const double r = reflectance(angle, 1.5);
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 16, 16, 4000)).mean(), (1 - r) / (1 + r), 0.01) << angle << " rad";
  }
}

TEST(Glass, a_slab_reflects_what_fresnel_says) {
  for (const double angle : {0.4, 1.0, 1.3}) {
    World world;
    world.add(box({5, 5, 0.001}), glass(1.5f), placed({0, 0, 1}, angle));
    world.set_environment(1.0f);
    world.add(quad({0, 0, 20}, {-3, 0, 0}, {0, 3, 0}), lambert(0.0f));
    world.desc().samples_per_pixel = 256;
    world.desc().max_bounces = 40;
    const double r = reflectance(angle, 1.5);
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 16, 16, 4000)).mean(), 2 * r / (1 + r), 0.01) << angle << " rad";
  }
}

TEST(Glass, a_tilted_slab_displaces_what_is_behind_it_as_snell_says) {
  // A plate of thickness t shifts a ray sideways by t sin(a) (1 - cos(a) / (n cos(a'))). A bright edge put there is seen at the image's
  // centre.
  const double t = 0.05, angle = 0.7, n = 1.5;
  const double shift = t * std::sin(angle) * (1 - std::cos(angle) / std::sqrt(n * n - std::pow(std::sin(angle), 2)));
  World world;
  world.add(box({1, 1, t / 2}), glass(float(n)), placed({0, 0, 1}, angle));
  // Turned by +angle about y the plate's near face looks towards +x, so rays are moved towards +x or -x: the edge tells which.
  for (const double side : {-1.0, 1.0})
    world.add(quad({side * shift + 5, 0, 2}, {-5, 0, 0}, {0, 5, 0}), lambert(0.0f), placed({0, 0, 100}));
  const uint32_t emitter_id = world.add(quad({5, 0, 2}, {-5, 0, 0}, {0, 5, 0}), emitter(1.0f));
  world.desc().samples_per_pixel = 64;
  world.desc().max_bounces = 2;  // straight through
  const double focal_px = 2000;
  double edge[2];
  for (int i = 0; i < 2; ++i) {
    const auto pose = placed({i == 0 ? -shift : shift, 0, 0});
    ok(kuafu_scene_set_instance_pose(world.scene(), emitter_id, pose.data()));
    const Pixels image = world.radiance(view_at({0, 0, 0}, 65, 5, focal_px));
    double bright = 0;
    for (uint32_t c = 0; c < 65; ++c) bright += image.at(0, 2, c);
    edge[i] = 65 - bright / std::pow(1 - reflectance(angle, n), 2) - 0.5;  // column where the bright part begins
  }
  // One of the two lies at the centre, column 32; the other is off by twice the shift.
  const double nearest = std::min(std::abs(edge[0] - 32), std::abs(edge[1] - 32));
  EXPECT_LT(nearest, 0.3) << edge[0] << " " << edge[1];
  EXPECT_GT(std::abs(edge[0] - edge[1]), 20);
}

// A body of the air's own index is not there, however rough: light goes straight through, a lamp's and a shadow ray's too.
TEST(Glass, of_index_one_is_not_there) {
  for (const float roughness : {0.0f, 0.1f, 0.6f})
    for (const bool lamp : {false, true}) {
      World world;
      kuafu_material_desc m = glass(1.0f);
      m.roughness = m.transmission_roughness = roughness;
      world.add(box({5, 5, 0.1}), m, placed({0, 0, 1}, 0.3));
      world.add(quad({0, 0, 3}, {-4, 0, 0}, {0, 4, 0}), lamp ? lambert(1.0f) : emitter(1.0f));
      if (lamp) world.add_point({0, 0, 0}, float(9 * pi));  // on the wall's middle: irradiance pi
      world.desc().samples_per_pixel = 64;
      EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 4000)).mean(), 1, 2e-3) << roughness << " " << lamp;
    }
}

TEST(Glass, total_internal_reflection_is_total) {
  // From inside a cube, 45 degrees to two pairs of walls: beyond the critical angle (41.8) at each of them, so no light from outside comes
  // in.
  World world;
  world.add(box({1, 1, 1}), glass(1.5f));
  world.set_environment(1.0f);
  world.desc().max_bounces = 12;
  EXPECT_EQ(world.radiance(view_at({0.1, 0, 0.2}, 8, 8, 500, pi / 4)).mean(), 0.0);
}

TEST(Glass, radiance_inside_is_n_squared_times_that_outside) {
  World world;
  world.add(box({1, 1, 1}), glass(1.5f));
  world.set_environment(1.0f);
  world.desc().max_bounces = 30;
  for (const float v : world.radiance(view_at({0.1, 0, 0.2}, 8, 8, 500)).values) ASSERT_NEAR(v, 2.25f, 0.01f);
}

}  // namespace
}  // namespace laws
