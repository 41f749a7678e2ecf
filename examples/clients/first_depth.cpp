// SPDX-License-Identifier: Apache-2.0
// The first depth map in C++17, with kuafu.hpp and simsense.hpp: kuafu renders the infrared pair of a scene under a dot projector, and
// simsense measures depth from it. Built as CMakeLists.txt beside this file says; run as: first_depth wall_and_board.obj
#include <algorithm>
#include <array>
#include <cstdio>
#include <random>
#include <vector>

#include "kuafu/kuafu.hpp"
#include "simsense/simsense.hpp"

namespace {
constexpr uint32_t width = 320, height = 240;
constexpr std::array<double, 9> camera_k{280, 0, 159.5, 0, 280, 119.5, 0, 0, 1}, projector_k{500, 0, 319.5, 0, 500, 239.5, 0, 0, 1};
constexpr double baseline_m = 0.05;

void add_projector(const kuafu::Scene& scene) {
  std::minstd_rand random(1);
  std::vector<std::array<float, 3>> dots(6000);  // u, v and brightness of each, in a pattern of 640x480
  for (auto& dot : dots) dot = {random() % 6400 / 10.0f, random() % 4800 / 10.0f, 6.0f};
  auto projector = kuafu_light_desc_init(KUAFU_LIGHT_PROJECTOR);
  projector.ir_intensity = 2, projector.light_to_world[3] = baseline_m / 2;
  std::copy(projector_k.begin(), projector_k.end(), projector.k);
  projector.dots = dots.front().data(), projector.dot_count = uint32_t(dots.size()), projector.dot_sigma_px = 1;
  projector.pattern_width = 640, projector.pattern_height = 480;
  uint32_t id = 0;
  kuafu::check(kuafu_scene_add_light(scene, &projector, &id));
}

std::vector<float> rendered_pair(const char* scene_file) {
  const kuafu::Device device;
  const kuafu::Scene scene(device);
  kuafu::check(kuafu_scene_load(scene, scene_file, nullptr, nullptr));
  add_projector(scene);
  std::array<kuafu_view_desc, 2> views{kuafu_view_desc_init(), kuafu_view_desc_init()};
  for (size_t side = 0; side < 2; ++side) {
    views[side].band = KUAFU_BAND_INFRARED;
    views[side].camera.width = width, views[side].camera.height = height;
    std::copy(camera_k.begin(), camera_k.end(), views[side].camera.k);
    views[side].camera.camera_to_world[3] = double(side) * baseline_m;
  }
  std::vector<float> pair(size_t{2} * height * width);
  const kuafu::Buffer buffer(device, pair.size() * sizeof(float), KS_BUFFER_HOST_VISIBLE);
  const std::array<uint64_t, 4> shape{2, height, width, 1};
  auto output = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, buffer, ks_image_desc_packed(KS_FORMAT_F32, 4, shape.data()));
  output.scale = 200;  // counts per W/(sr m^2)
  auto render = kuafu_render_desc_init();
  render.views = views.data(), render.view_count = 2, render.outputs = &output, render.output_count = 1;
  kuafu::check(kuafu_renderer_render(kuafu::Renderer(device), scene, &render));
  kuafu::check(kuafu_buffer_read(buffer, 0, pair.data(), pair.size() * sizeof(float)));
  return pair;
}

std::vector<float> measured_depth_m(std::vector<float> pair) {
  auto rig = simsense_rig_desc_init();
  rig.left.width = width, rig.left.height = height;
  std::copy(camera_k.begin(), camera_k.end(), rig.left.k);
  rig.right = rig.left;
  rig.left_to_right[3] = -baseline_m, rig.rectified = 1;
  std::vector<float> depth_m(size_t{height} * width);
  const std::array<uint64_t, 2> shape{height, width};
  const ks_image_desc image = ks_image_desc_packed(KS_FORMAT_F32, 2, shape.data());
  const auto output = simsense_output_desc_init(SIMSENSE_OUTPUT_DEPTH, {nullptr, depth_m.data(), image});
  auto compute = simsense_compute_desc_init();
  compute.left = {nullptr, pair.data(), image}, compute.right = {nullptr, pair.data() + depth_m.size(), image};
  compute.outputs = &output, compute.output_count = 1;
  simsense::check(simsense_engine_compute(simsense::Engine(simsense::Device(), rig), &compute));
  return depth_m;
}

}  // namespace

int main(int count, char** arguments) try {
  const std::vector<float> depth_m = measured_depth_m(rendered_pair(count > 1 ? arguments[1] : "wall_and_board.obj"));
  std::printf("wall %.2f m, board %.2f m\n", depth_m[20 * width + 200], depth_m[130 * width + 200]);
} catch (const ks::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
