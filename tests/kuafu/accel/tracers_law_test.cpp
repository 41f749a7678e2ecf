// SPDX-License-Identifier: Apache-2.0
// The tracers are interchangeable: same images from each, and each follows meshes that deform.
#include "kuafu/world.h"

namespace laws {
namespace {

struct Kind {
  const char* name;
  uint32_t tracer;
};
void PrintTo(const Kind& kind, std::ostream* out) { *out << kind.name; }
constexpr Kind kinds[] = {{"Embree", KUAFU_TRACER_EMBREE}, {"Compute", KUAFU_TRACER_COMPUTE}, {"RtPipeline", KUAFU_TRACER_RT_PIPELINE}};

class EachTracer : public testing::TestWithParam<Kind> {
 protected:
  void SetUp() override { SKIP_IF(why_not(GetParam().tracer)); }
};
std::string name_of(const testing::TestParamInfo<Kind>& info) { return info.param.name; }
INSTANTIATE_TEST_SUITE_P(All, EachTracer, testing::ValuesIn(kinds), name_of);
class OtherTracer : public EachTracer {};
INSTANTIATE_TEST_SUITE_P(All, OtherTracer, testing::Values(kinds[0], kinds[2]), name_of);

const kuafu_view_desc view = view_at({0, 0, 0}, 64, 48, 50);

/// A table, a wall, boxes and balls under a projector, a lamp and an ambient.
void furnish(World& world, bool glossy) {
  world.add(quad({0, 0, 1.3}, {-1, 0, 0}, {0, 1, 0}), lambert(0.6f));
  world.add(quad({0, 0.3, 0.8}, {-1, 0, 0}, {0, 0, -0.6}), lambert(0.7f));
  world.add(box({0.08, 0.08, 0.08}), lambert(0.5f), placed({0.02, 0.22, 0.95}, 0.5));
  world.add(sphere(0.13, 16, true), glossy ? metal(0.3f) : lambert(0.8f), placed({-0.22, 0.15, 0.85}));
  world.add(sphere(0.12, 16, true), glossy ? glass(1.5f) : lambert(0.4f), placed({0.24, 0.15, 0.75}));
  world.add_projector(dotted(64 * 64), 64, 64, 50, 1.0f, placed({0.05, 0, 0}));
  world.add_point({-0.4, -0.4, 0.3}, 0.2f);
  world.set_environment(0.1f);
}

Pixels image_by(uint32_t tracer, bool glossy) {
  World world(tracer);
  furnish(world, glossy);
  return world.radiance(view, 64);
}

TEST_P(OtherTracer, gives_the_image_of_the_own_bvh) {
  const double diffuse = relative_difference(image_by(KUAFU_TRACER_COMPUTE, false), image_by(GetParam().tracer, false));
  const double glossy = relative_difference(image_by(KUAFU_TRACER_COMPUTE, true), image_by(GetParam().tracer, true));
  RecordProperty("diffuse", std::to_string(diffuse));
  RecordProperty("glossy", std::to_string(glossy));
  EXPECT_LT(diffuse, 1e-4);
  EXPECT_LT(glossy, 5e-3);
}

/// The ball of `furnish`, pressed flat and moved.
Shape pressed(Shape ball) {
  for (size_t i = 0; i < ball.positions.size(); i += 3) {
    ball.positions[i] = 1.4f * ball.positions[i] + 0.05f;
    ball.positions[i + 1] *= 0.5f;
    float* n = &ball.normals[i];
    n[0] /= 1.4f, n[1] /= 0.5f;
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3; ++k) n[k] /= length;
  }
  return ball;
}

TEST_P(EachTracer, a_deformed_mesh_looks_like_one_made_so) {
  const std::vector<uint32_t> outputs = {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_DEPTH, KUAFU_OUTPUT_NORMAL};
  const Shape ball = sphere(0.2, 24, true), flat = pressed(ball);
  const auto furnished = [&](World& world, const Shape& shape) {
    world.add(quad({0, 0, 1.3}, {-1, 0, 0}, {0, 1, 0}), lambert(0.6f));
    world.add(shape, lambert(0.5f), placed({0, 0, 0.9}));
    world.add_point({-0.4, -0.4, 0.3}, 0.5f);
  };
  World made(GetParam().tracer), deformed(GetParam().tracer);
  furnished(made, flat);
  furnished(deformed, ball);
  const auto before = deformed.render({view}, outputs);
  const uint32_t mesh = 2;
  ok(kuafu_scene_update_mesh(deformed.scene(), mesh, flat.positions.data(), flat.normals.data(), uint32_t(flat.positions.size() / 3)));
  auto expected = made.render({view}, outputs), after = deformed.render({view}, outputs);
  for (const uint32_t output : outputs) {
    EXPECT_LT(relative_difference(expected[output], after[output]), 1e-4) << "output " << output;
    EXPECT_GT(relative_difference(expected[output], before.at(output)), 1e-2) << "output " << output;
  }
}

TEST(Deformation, misuse_is_an_error_that_says_why) {
  World world;
  world.add(sphere(0.2, 4, true), lambert(0.5f));
  const Shape ball = sphere(0.2, 4, true);
  const auto count = uint32_t(ball.positions.size() / 3);
  const float *positions = ball.positions.data(), *normals = ball.normals.data();
  expect_refused(kuafu_scene_update_mesh(world.scene(), 2, positions, normals, count), "there is no mesh 2");
  expect_refused(kuafu_scene_update_mesh(world.scene(), 1, positions, normals, count - 1), "positions for its");
  expect_refused(kuafu_scene_update_mesh(world.scene(), 1, positions, nullptr, count), "0 normals");
  expect_refused(kuafu_scene_update_mesh(world.scene(), 1, nullptr, normals, count), "positions is NULL");
  std::vector<float> spoilt = ball.positions;
  spoilt[4] = NAN;
  expect_refused(kuafu_scene_update_mesh(world.scene(), 1, spoilt.data(), normals, count), "position 1 is not finite");
}

TEST(Tracers, one_that_the_device_lacks_is_refused_with_what_to_use) {
  if (why_not(KUAFU_TRACER_RT_PIPELINE).empty()) GTEST_SKIP() << "this device has every tracer";
  const kuafu_renderer_desc desc{ks_header_make(KUAFU_TYPE_RENDERER_DESC, sizeof desc), KUAFU_TRACER_RT_PIPELINE, 0};
  kuafu_renderer renderer = nullptr;
  EXPECT_EQ(kuafu_renderer_create(shared_device(), &desc, &renderer), KS_ERROR_UNSUPPORTED);
  const std::string message = kuafu_last_error();
  EXPECT_NE(message.find("VK_KHR_ray_tracing_pipeline"), std::string::npos) << message;
  EXPECT_NE(message.find("KUAFU_TRACER_AUTO"), std::string::npos) << message;
}

}  // namespace
}  // namespace laws
