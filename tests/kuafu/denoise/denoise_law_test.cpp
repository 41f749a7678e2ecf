// SPDX-License-Identifier: Apache-2.0
// The denoiser: what it must keep, and how much noise it must take.
#include <algorithm>

#include "kuafu/world.h"

namespace laws {
namespace {

constexpr uint32_t width = 64, height = 48;
const std::vector<uint32_t> groups = {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_PROJECTOR_DIRECT, KUAFU_OUTPUT_PROJECTOR_INDIRECT,
                                      KUAFU_OUTPUT_AMBIENT};

/// A ball and a box before a wall, an area light above, dots over all.
void furnish(World& world) {
  world.add(quad({0, 0, 2}, {-2, 0, 0}, {0, 2, 0}), lambert(0.6f));
  world.add(quad({0, 0.5, 1.2}, {-2, 0, 0}, {0, 0, -1}), lambert(0.4f));
  world.add(sphere(0.25, 16, true), lambert(0.8f), placed({-0.25, 0.2, 1.2}));
  world.add(box({0.15, 0.2, 0.15}), lambert(0.2f), placed({0.35, 0.3, 1.4}, 0.5));
  world.add_projector(dotted(61 * 45), 61, 45, 60, 2.0f, placed({0.05, 0, 0}));
  kuafu_light_desc lamp = rectangle_light(3, 0.5, 0.5);
  for (float& i : lamp.intensity) i = 3;
  world.add_light(lamp, {1, 0, 0, 0.3, 0, 0, 1, -1.2, 0, -1, 0, 1, 0, 0, 0, 1});
  world.set_environment(0.2f);
}

kuafu_view_desc view() { return view_at({0, 0, 0}, width, height, 60); }

double rms(const Pixels& a, const Pixels& b) {
  double sum = 0;
  for (size_t i = 0; i < a.values.size(); ++i) sum += double(a.values[i] - b.values[i]) * (a.values[i] - b.values[i]);
  return std::sqrt(sum / double(a.values.size()));
}

class Denoise : public testing::TestWithParam<uint32_t> {
 protected:
  Denoise() : world_(GetParam()) { world_.desc().max_bounces = 3; }
  std::map<uint32_t, Pixels> render(uint32_t samples, uint32_t kind, const kuafu_view_desc& of = view()) {
    world_.desc().samples_per_pixel = samples;
    world_.desc().denoise = kind;
    return world_.render({of}, groups);
  }
  /// A wall 4 m wide, which are 120 px, in even light, with a texture that is repeated so often.
  void add_textured(const std::vector<float>& texels, float repeat) {
    kuafu_material_desc material = lambert(1);
    material.base_color_texture = world_.add_texture(texture_of(texels, 2));
    Shape wall = quad({0, 0, 2}, {-2, 0, 0}, {0, 2, 0});
    wall.uvs = {0, 0, repeat, 0, repeat, repeat, 0, repeat};
    world_.add(wall, material);
    world_.set_environment(1);
  }
  void expect_half_of_the_error(uint32_t samples, const kuafu_view_desc& of = view()) {
    const Pixels plain = render(samples, KUAFU_DENOISE_NONE, of)[KUAFU_OUTPUT_AMBIENT],
                 clean = render(samples, KUAFU_DENOISE_ATROUS, of)[KUAFU_OUTPUT_AMBIENT],
                 truth = render(128, KUAFU_DENOISE_NONE, of)[KUAFU_OUTPUT_AMBIENT];
    EXPECT_LT(rms(clean, truth), 0.5 * rms(plain, truth));
  }
  World world_;
};

TEST_P(Denoise, projector_direct_keeps_every_bit_and_groups_sum_to_the_image) {
  furnish(world_);
  auto plain = render(2, KUAFU_DENOISE_NONE), clean = render(2, KUAFU_DENOISE_ATROUS);
  EXPECT_EQ(plain[KUAFU_OUTPUT_PROJECTOR_DIRECT].values, clean[KUAFU_OUTPUT_PROJECTOR_DIRECT].values);
  EXPECT_NE(plain[KUAFU_OUTPUT_AMBIENT].values, clean[KUAFU_OUTPUT_AMBIENT].values);
  for (size_t i = 0; i < width * height; ++i) {
    const float sum = clean[KUAFU_OUTPUT_PROJECTOR_DIRECT].values[i] + clean[KUAFU_OUTPUT_PROJECTOR_INDIRECT].values[i] +
                      clean[KUAFU_OUTPUT_AMBIENT].values[i];
    ASSERT_NEAR(clean[KUAFU_OUTPUT_RADIANCE].values[i], sum, 1e-6 * sum);
  }
  EXPECT_NEAR(clean[KUAFU_OUTPUT_AMBIENT].mean(), plain[KUAFU_OUTPUT_AMBIENT].mean(), 0.02 * plain[KUAFU_OUTPUT_AMBIENT].mean());
}

TEST_P(Denoise, even_light_stays_even) {
  world_.add(quad({0, 0, 2}, {-9, 0, 0}, {0, 9, 0}), lambert(0.5f));
  world_.set_environment(1);
  world_.desc().max_bounces = 0;
  const Pixels clean = render(1, KUAFU_DENOISE_ATROUS)[KUAFU_OUTPUT_RADIANCE];
  for (const float value : clean.values) ASSERT_NEAR(value, 0.5, 1e-5);
}

TEST_P(Denoise, textures_come_back_finer_than_the_samples) {
  // A checkerboard of half a pixel's period: every pixel's square has the mean albedo, its two samples do not.
  add_textured({0.2f, 0.8f, 0.8f, 0.2f}, 120);
  world_.desc().max_bounces = 0;
  expect_half_of_the_error(2);
}

TEST_P(Denoise, what_lens_and_motion_blur_stays_blurred) {
  // Stripes as wide as the blur is long: every pixel sees dark and bright ones.
  add_textured({0.1f, 0.9f}, 15);
  world_.add(sphere(0.25, 16, true), lambert(0.8f), placed({0.2, 0.1, 1.2}));
  world_.desc().max_bounces = 1;
  kuafu_view_desc moving = view(), defocused = view();
  moving.camera.exposure_s = 0.01;
  moving.camera.linear_velocity[0] = 27;  // 8 px at the wall
  defocused.camera.lens_radius_m = 0.1;
  defocused.camera.focus_m = 1.2;  // 2 px at the wall, in radius
  for (const kuafu_view_desc& of : {moving, defocused}) expect_half_of_the_error(4, of);
}

INSTANTIATE_TEST_SUITE_P(, Denoise, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE), stages_name);

Pixels ambient(World& world, const kuafu_view_desc& of, uint32_t samples, uint32_t kind) {
  world.desc().samples_per_pixel = samples;
  world.desc().denoise = kind;
  return world.image(of, KUAFU_OUTPUT_AMBIENT);
}

const kuafu_view_desc large = view_at({0, 0, 0}, 2 * width, 2 * height, 120);

Pixels clean_image(World& world, uint32_t band) {
  furnish(world);
  world.desc().denoise = KUAFU_DENOISE_ATROUS;
  kuafu_view_desc of = view();
  of.band = band;
  return world.radiance(of, 2, 3);
}

TEST(Denoiser, host_stages_and_compute_agree_in_colour) {
  SKIP_IF(why_not(KUAFU_TRACER_EMBREE));
  World host(KUAFU_TRACER_EMBREE), compute(KUAFU_TRACER_COMPUTE);
  const Pixels a = clean_image(host, KUAFU_BAND_VISIBLE), b = clean_image(compute, KUAFU_BAND_VISIBLE);
  EXPECT_LT(rms(a, b), 2e-3 * a.mean());
}

TEST(Denoiser, two_samples_become_as_good_as_thirty_two_and_many_stay) {
  World world;
  furnish(world);
  world.desc().max_bounces = 3;
  const Pixels truth = ambient(world, large, 256, KUAFU_DENOISE_NONE);
  world.desc().seed = 9;
  const auto error = [&](uint32_t samples, uint32_t kind) { return rms(ambient(world, large, samples, kind), truth); };
  EXPECT_LT(error(2, KUAFU_DENOISE_ATROUS), error(32, KUAFU_DENOISE_NONE));
  EXPECT_LT(error(128, KUAFU_DENOISE_ATROUS), error(128, KUAFU_DENOISE_NONE));
}

// The ball's shadow and its light on the wall are finer than the filter: where samples are sure of them, pixels keep what they have.
TEST(Denoiser, a_converged_image_keeps_itself) {
  World world;
  world.desc().max_bounces = 2;
  world.add(quad({0, 0, 1.4}, {-2, 0, 0}, {0, 2, 0}), lambert(0.5f));
  world.add(sphere(0.2, 32, true), lambert(0.9f), placed({0, 0, 1.2}));
  world.add_light(light_of(KUAFU_LIGHT_DISK, 10, 0.2), {1, 0, 0, 0.6, 0, 1, 0, -0.6, 0, 0, 1, 0, 0, 0, 0, 1});
  const kuafu_view_desc of = view_at({0, 0, 0}, width, height, 50);
  world.desc().seed = 1;
  const Pixels truth = ambient(world, of, 512, KUAFU_DENOISE_NONE);
  world.desc().seed = 2;
  EXPECT_LT(rms(ambient(world, of, 128, KUAFU_DENOISE_ATROUS), truth), rms(ambient(world, of, 128, KUAFU_DENOISE_NONE), truth));
}

TEST(Denoiser, same_bits_for_any_thread_count) {
  SKIP_IF(why_not(KUAFU_TRACER_EMBREE));
  World one(KUAFU_TRACER_EMBREE, 1), three(KUAFU_TRACER_EMBREE, 3);
  EXPECT_EQ(clean_image(one, KUAFU_BAND_INFRARED).values, clean_image(three, KUAFU_BAND_INFRARED).values);
}

TEST(Denoiser, light_groups_are_filtered_and_sum_to_ambient) {
  World world;
  furnish(world);
  kuafu_light_desc lamp = rectangle_light(5, 0.3, 0.3);
  lamp.light_group = 2;
  world.add_light(lamp, {1, 0, 0, -0.6, 0, 0, 1, -1.0, 0, -1, 0, 1, 0, 0, 0, 1});
  world.desc().samples_per_pixel = 2;
  const std::vector<uint32_t> outputs = {KUAFU_OUTPUT_AMBIENT, KUAFU_OUTPUT_LIGHT_GROUP_0, KUAFU_OUTPUT_LIGHT_GROUP_0 + 2};
  auto plain = world.render({view()}, outputs);
  world.desc().denoise = KUAFU_DENOISE_ATROUS;
  auto clean = world.render({view()}, outputs);
  for (const uint32_t group : {KUAFU_OUTPUT_LIGHT_GROUP_0, KUAFU_OUTPUT_LIGHT_GROUP_0 + 2}) {
    EXPECT_NE(plain[group].values, clean[group].values);
    EXPECT_NEAR(plain[group].mean(), clean[group].mean(), 0.03 * plain[group].mean());
  }
  for (size_t i = 0; i < width * height; ++i) {
    const float sum = clean[KUAFU_OUTPUT_LIGHT_GROUP_0].values[i] + clean[KUAFU_OUTPUT_LIGHT_GROUP_0 + 2].values[i];
    ASSERT_NEAR(clean[KUAFU_OUTPUT_AMBIENT].values[i], sum, 1e-6 * sum);
  }
}

/// Renders of a moving camera with different seeds; the last one's ambient light.
Pixels last_of_many(World& world, int renders, double step_m) {
  Pixels image;
  for (int i = 0; i < renders; ++i) {
    world.desc().seed = uint64_t(100 + i);
    image = world.image(view_at({step_m * (i + 1 - renders), 0, 0}, width, height, 60), KUAFU_OUTPUT_AMBIENT);
  }
  return image;
}

TEST(Temporal, what_appears_starts_anew) {
  World world;
  world.add(quad({0, 0, 2}, {-9, 0, 0}, {0, 9, 0}), lambert(0.5f));
  const uint32_t lamp = world.add(quad({0, 0, 1}, {-0.2, 0, 0}, {0, 0.2, 0}), emitter(3));
  world.set_environment(1);
  world.take(1, 0);
  world.desc().denoise = KUAFU_DENOISE_ATROUS;
  world.desc().temporal_weight = 0.9f;
  EXPECT_GT(last_of_many(world, 4, 0).at(0, height / 2, width / 2), 2.9f);
  ok(kuafu_scene_remove_instance(world.scene(), lamp));
  const Pixels image = last_of_many(world, 1, 0);
  for (const float value : image.values) ASSERT_NEAR(value, 0.5, 0.1);  // beside the lamp, samples of pixels on its edge were mixed
}

TEST(Temporal, nothing_is_kept_unless_asked_for) {
  World world;
  furnish(world);
  world.desc().samples_per_pixel = 2;
  world.desc().denoise = KUAFU_DENOISE_ATROUS;
  const Pixels alone = last_of_many(world, 1, 0);
  world.desc().temporal_weight = 0.9f;
  EXPECT_LT(rms(last_of_many(world, 1, 0), alone), 1e-6);  // the first has nothing to follow, but another order of sums
  world.desc().temporal_weight = 0;
  EXPECT_EQ(last_of_many(world, 1, 0).values, alone.values);
}

/// Eight renders of one sample each, that follow each other or not, against many samples of the last: root mean square errors.
struct Followed {
  double alone, followed;
};

template <class Frame>
Followed follow(const Frame& frame) {
  constexpr int renders = 8;
  World world;
  world.desc().max_bounces = 3;
  Pixels images[3];
  for (int kind = 0; kind < 3; ++kind) {  // truth, alone, followed
    world.desc().samples_per_pixel = kind == 0 ? 128 : 1;
    world.desc().denoise = kind == 0 ? KUAFU_DENOISE_NONE : KUAFU_DENOISE_ATROUS;
    world.desc().temporal_weight = kind == 2 ? 0.95f : 0.0f;
    for (int i = kind == 2 ? 0 : renders - 1; i < renders; ++i) {
      world.desc().seed = uint64_t(100 + i);
      images[kind] = world.image(frame(world, i - (renders - 1)), KUAFU_OUTPUT_AMBIENT);
    }
  }
  return {rms(images[1], images[0]), rms(images[2], images[0])};
}

kuafu_view_desc furnished(World& world, const kuafu_view_desc& view) {
  kuafu_scene_summary summary = kuafu_scene_summary_init();
  ok(kuafu_scene_get_summary(world.scene(), &summary));
  if (summary.instance_count == 0) furnish(world);
  return view;
}

/// It turns by two pixels from frame to frame: most of what it sees at last it has seen eight times.
kuafu_view_desc panned(int frame) { return view_at({0, 0, 0}, width, height, 60, 0.035 * frame); }

TEST(Temporal, a_camera_that_pans_sees_as_well_as_one_that_stands_still) {
  const Followed still = follow([](World& world, int) { return furnished(world, panned(0)); });
  const Followed panning = follow([](World& world, int frame) { return furnished(world, panned(frame)); });
  const Followed rolling = follow([](World& world, int frame) {  // as much from its first line to its last as between frames
    kuafu_view_desc view = panned(frame);
    view.camera.lens.distortion[0] = -0.15;
    view.camera.shutter = KUAFU_SHUTTER_ROLLING;
    view.camera.line_time_s = 1e-3;
    view.camera.angular_velocity[1] = 0.035 / (height * 1e-3);
    return furnished(world, view);
  });
  EXPECT_LT(still.followed, 0.7 * still.alone);
  for (const Followed& f : {panning, rolling}) EXPECT_LT(f.followed / f.alone, 1.25 * still.followed / still.alone);
}

/// The furniture and its lamp, to the left by as much as the camera would go to the right.
void slide(World& world, double way_m) {
  std::array<double, 16> poses[4] = {placed({0, 0, 0}), placed({0, 0, 0}), placed({-0.25, 0.2, 1.2}), placed({0.35, 0.3, 1.4}, 0.5)};
  for (uint32_t id = 0; id < 4; ++id) {
    poses[id][3] -= way_m;
    ok(kuafu_scene_set_instance_pose(world.scene(), id + 1, poses[id].data()));
  }
  kuafu_light_desc lamp = kuafu_light_desc_init(KUAFU_LIGHT_RECTANGLE);
  ok(kuafu_scene_get_light(world.scene(), 2, &lamp));
  lamp.light_to_world[3] = 0.3 - way_m;
  ok(kuafu_scene_set_light(world.scene(), 2, &lamp));
}

TEST(Temporal, a_world_that_slides_past_the_camera_is_seen_as_by_a_camera_that_slides) {
  const Followed camera = follow([](World& world, int i) { return furnished(world, view_at({0.04 * i, 0, 0}, width, height, 60)); });
  const Followed things = follow([](World& world, int i) {
    const kuafu_view_desc seen = furnished(world, view());
    slide(world, 0.04 * i);
    return seen;
  });
  EXPECT_LT(camera.followed, 0.75 * camera.alone);
  EXPECT_LT(things.followed, 1.15 * camera.followed);
}

TEST(Temporal, light_that_goes_out_leaves_no_more_than_noise) {
  World world;
  furnish(world);
  world.take(2, 3);
  world.desc().denoise = KUAFU_DENOISE_ATROUS;
  world.desc().temporal_weight = 0.95f;
  last_of_many(world, 8, 0);
  kuafu_light_desc lamp = kuafu_light_desc_init(KUAFU_LIGHT_RECTANGLE);
  ok(kuafu_scene_get_light(world.scene(), 2, &lamp));
  lamp.ir_intensity *= 0.2f;
  ok(kuafu_scene_set_light(world.scene(), 2, &lamp));
  const Pixels image = last_of_many(world, 1, 0);
  world.desc().temporal_weight = 0;
  world.desc().samples_per_pixel = 64;
  const double truth = last_of_many(world, 1, 0).mean();
  EXPECT_NEAR(image.mean(), truth, 0.2 * truth);
}

TEST(Temporal, what_moved_leaves_no_ghost) {
  World world;
  world.add(quad({0, 0, 2}, {-9, 0, 0}, {0, 9, 0}), emitter(0.5f));
  const uint32_t lamp = world.add(quad({0, 0, 0}, {-0.2, 0, 0}, {0, 0.2, 0}), emitter(3));
  world.take(1, 0);
  world.desc().denoise = KUAFU_DENOISE_ATROUS;
  world.desc().temporal_weight = 0.95f;
  Pixels image;
  for (int i = 0; i < 6; ++i) {  // 3 pixels a frame, until it has left the image
    const std::array<double, 16> pose = placed({i < 5 ? 0.05 * i : 50.0, 0, 1});
    ok(kuafu_scene_set_instance_pose(world.scene(), lamp, pose.data()));
    image = last_of_many(world, 1, 0);
    for (uint32_t row = 0; row < height; ++row)
      for (uint32_t column = 0; column < width; ++column) {
        const double x = (column - (width - 1) / 2.0) / 60, y = (row - (height - 1) / 2.0) / 60,
                     way = std::max(std::abs(x - pose[3]), std::abs(y));
        if (std::abs(way - 0.2) < 1.5 / 60) continue;  // on its edge
        ASSERT_NEAR(image.at(0, row, column), way < 0.2 ? 3.0 : 0.5, 0.01) << "frame " << i << ", row " << row << ", column " << column;
      }
  }
}

/// What a renderer with this library answers when Open Image Denoise is asked for; NULL: wherever it is found.
ks_status render_by_oidn(World& world, const char* library, Pixels& image) {
  kuafu_renderer_desc desc{ks_header_make(KUAFU_TYPE_RENDERER_DESC, sizeof desc), KUAFU_TRACER_AUTO, 0, library};
  kuafu_renderer renderer = nullptr;
  ok(kuafu_renderer_create(shared_device(), &desc, &renderer));
  kuafu_buffer buffer = nullptr;
  image = {1, 2 * height, 2 * width, 1, std::vector<float>(4 * width * height)};
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(image.values.size() * 4, KS_BUFFER_HOST_VISIBLE);
  ok(kuafu_buffer_create(shared_device(), &create, &buffer));
  const uint64_t shape[4] = {1, image.height, image.width, 1};
  const kuafu_output_desc output = kuafu_output_desc_init(KUAFU_OUTPUT_AMBIENT, buffer, ks_image_desc_packed(KS_FORMAT_F32, 4, shape));
  kuafu_render_desc render = world.desc();
  render.views = &large;
  render.outputs = &output;
  render.view_count = render.output_count = 1;
  render.samples_per_pixel = 2;
  render.denoise = KUAFU_DENOISE_OIDN;
  const ks_status status = kuafu_renderer_render(renderer, world.scene(), &render);
  const std::string why = kuafu_last_error();
  ok(kuafu_buffer_read(buffer, 0, image.values.data(), image.values.size() * 4));
  kuafu_buffer_release(buffer);
  kuafu_renderer_release(renderer);
  if (status == KS_ERROR_UNSUPPORTED) {
    EXPECT_NE(why.find("KUAFU_OIDN_LIBRARY"), std::string::npos) << why;
  }
  return status;
}

TEST(Oidn, a_library_that_is_not_there_is_named) {
  World world;
  furnish(world);
  Pixels image;
  EXPECT_EQ(render_by_oidn(world, "/no/such/libOpenImageDenoise.so", image), KS_ERROR_UNSUPPORTED);
}

TEST(Oidn, takes_noise_where_it_is_found) {
  World world;
  furnish(world);
  world.desc().max_bounces = 3;
  Pixels image;
  const ks_status status = render_by_oidn(world, nullptr, image);
  if (status == KS_ERROR_UNSUPPORTED) GTEST_SKIP() << "Open Image Denoise is not here: name its library in KUAFU_OIDN_LIBRARY to test it";
  ASSERT_EQ(status, KS_OK);
  const Pixels truth = ambient(world, large, 128, KUAFU_DENOISE_NONE);
  EXPECT_LT(rms(image, truth), 0.5 * rms(ambient(world, large, 2, KUAFU_DENOISE_NONE), truth));
}

TEST(Denoiser, views_of_a_batch_are_as_if_alone) {
  World world;
  furnish(world);
  world.desc().denoise = KUAFU_DENOISE_ATROUS;
  world.desc().samples_per_pixel = 2;
  kuafu_view_desc other = view_at({0.1, 0, 0}, width, height, 60);
  const Pixels both = world.render({view(), other}, {KUAFU_OUTPUT_RADIANCE})[KUAFU_OUTPUT_RADIANCE], alone = world.radiance(other);
  EXPECT_TRUE(std::equal(alone.values.begin(), alone.values.end(), both.values.begin() + width * height));
}

}  // namespace
}  // namespace laws
