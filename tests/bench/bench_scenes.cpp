// SPDX-License-Identifier: Apache-2.0
// What a change to a living scene costs, beside rebuilding it, with 1, 100 and 10 000 instances: milliseconds of host time that the next
// render spends on tables and acceleration structures (its stages "upload" and "acceleration build"), least of some repetitions.
// Usage: bench_scenes [repetitions = 20]
#include <functional>

#include "render_bench.h"

namespace bench {
namespace {

/// Milliseconds that the last render spent on following the scene.
double update_ms(Renderer& renderer) {
  double sum = 0;
  for (const auto& [name, ms] : renderer.stage_times())
    if (name == "upload" || name == "acceleration build") sum += ms;
  return sum;
}

struct World {
  kuafu_scene scene;
  std::vector<uint32_t> instances;
  uint32_t mesh, deforming, material, light;
};

Pose somewhere(std::mt19937& engine) {
  const auto number = [&] { return double(engine() % 10000) / 1000.0 - 5.0; };
  const double x = number(), y = number();
  return placed({x, y, 0.5 + 0.05 * number()}, number(), 0.05);
}

World make(kuafu_device device, uint32_t count) {
  World w{nullptr, {}, 0, 0, 0, 0};
  ok(kuafu_scene_create(device, &w.scene));
  w.mesh = add_shape(w.scene, ball(20, 0.04, 1));
  w.deforming = add_shape(w.scene, ball(20, 0.04, 2));
  kuafu_material_desc material = kuafu_material_desc_init();
  ok(kuafu_scene_add_material(w.scene, &material, &w.material));
  std::mt19937 engine(7);
  for (uint32_t i = 0; i < count; ++i)
    w.instances.push_back(add_instance(w.scene, i == 0 ? w.deforming : w.mesh, w.material, somewhere(engine)));
  kuafu_light_desc sun = kuafu_light_desc_init(KUAFU_LIGHT_DIRECTIONAL);
  sun.ir_intensity = 1;
  ok(kuafu_scene_add_light(w.scene, &sun, &w.light));
  return w;
}

void measure(kuafu_device device, const char* name, uint32_t tracer, uint32_t count, int repetitions) {
  World w = make(device, count);
  Renderer renderer(device, tracer);
  renderer.look({camera(16, 16)}, KUAFU_BAND_INFRARED);
  renderer.settings.samples_per_pixel = 1;
  renderer.settings.max_bounces = 0;
  std::mt19937 engine(8);
  Shape moving = ball(20, 0.04, 2);
  const auto best = [&](const std::function<void()>& change) {
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < repetitions; ++i) {
      change();
      renderer.render(w.scene);
      if (i > 0) least = std::min(least, update_ms(renderer));  // a mesh that deforms the first time is rebuilt
    }
    return least;
  };
  double full = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {  // a renderer that meets the scene again after another knows nothing of it
    const World other = make(device, 1);
    renderer.render(other.scene);
    renderer.render(w.scene);
    full = std::min(full, update_ms(renderer));
    kuafu_scene_release(other.scene);
  }
  const auto one = [&] { return w.instances[engine() % count]; };
  const double none = best([] {});
  const double moved = best([&] { ok(kuafu_scene_set_instance_pose(w.scene, one(), somewhere(engine).data())); });
  const double coloured = best([&] { ok(kuafu_scene_set_instance_materials(w.scene, one(), &w.material, 1)); });
  const double came_and_went = best([&] {
    ok(kuafu_scene_remove_instance(w.scene, w.instances.back()));
    w.instances.back() = add_instance(w.scene, w.mesh, w.material, somewhere(engine));
  });
  const double deformed = best([&] {
    for (float& p : moving.positions) p += 1e-4f * float(int(engine() % 3) - 1);
    ok(kuafu_scene_update_mesh(w.scene, w.deforming, moving.positions.data(), moving.normals.data(),
                               uint32_t(moving.positions.size() / 3)));
  });
  const double lit = best([&] {
    kuafu_light_desc sun = kuafu_light_desc_init(KUAFU_LIGHT_DIRECTIONAL);
    sun.ir_intensity = float(engine() % 100);
    ok(kuafu_scene_set_light(w.scene, w.light, &sun));
  });
  std::printf("%-8s %6u %9.3f %9.3f %9.3f %9.3f %9.3f %9.3f %9.3f   %.4f\n", name, count, full, none, moved, coloured, came_and_went,
              deformed, lit, moved / full);
  kuafu_scene_release(w.scene);
}

int run(int repetitions) {
  kuafu_device device = open_device();
  const ks_device_info info = info_of(device);
  std::printf("device: %s, %s\nms         instances rebuilt nothing     moved  material  exchanged  deformed     light   moved/rebuilt\n",
              info.name, info.driver);
  const auto all = [&](const char* name, uint32_t tracer) {
    for (const uint32_t count : {1u, 100u, 10000u}) measure(device, name, tracer, count, repetitions);
  };
  if (info.kind == KS_DEVICE_KIND_CPU) all("embree", KUAFU_TRACER_EMBREE);
  all("compute", KUAFU_TRACER_COMPUTE);
  if (info.capabilities & KS_CAP_RAY_TRACING_PIPELINE) all("rt", KUAFU_TRACER_RT_PIPELINE);
  kuafu_device_release(device);
  return 0;
}

}  // namespace
}  // namespace bench

int main(int argc, char** argv) { return bench::run(argc > 1 ? std::atoi(argv[1]) : 20); }
