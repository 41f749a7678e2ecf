// SPDX-License-Identifier: Apache-2.0
// All tracers that the device has, on the same rays: Mray/s of primary, bounced and shadow rays, and milliseconds of updates. Prints
// ratios, which are what to trust. Usage: bench_tracers [image side = 512] [repetitions = 5]
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "kuafu/accel/worlds.h"

namespace kuafu::test {
namespace {

double now_ms() { return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// About 100 k triangles: a floor and 36 spheres of 2.8 k triangles each.
Scene table_top() {
  Scene scene;
  const uint32_t ball = scene.add_mesh(sphere(26));
  Mesh plane;
  plane.positions = {{-9, -9, 0}, {9, -9, 0}, {9, 9, 0}, {-9, 9, 0}};
  plane.indices = {{0, 1, 2}, {0, 2, 3}};
  scene.add_instance(place(scene.add_mesh(plane), pose({0.0, 0.0, 5.0})));
  Random random(1);
  for (int i = 0; i < 36; ++i) {
    const glm::dvec3 at(1.3 * (i % 6) - 3.25, 1.3 * int(i / 6) - 3.25, 4.5);
    scene.add_instance(place(ball, pose(at, glm::dvec3(0.5), random.uniform(0.0, 6.0), random.direction())));
  }
  return scene;
}

std::vector<TestRay> from_hits(const std::vector<TestRay>& rays, const std::vector<TestHit>& hits, bool to_light) {
  Random random(2);
  std::vector<TestRay> out;
  for (size_t i = 0; i < rays.size(); ++i) {
    if (!hits[i].hit) continue;
    TestRay ray;
    ray.origin = rays[i].origin + 0.9999f * hits[i].t * rays[i].direction;
    ray.t_near = 1e-4f;
    const glm::vec3 light(1.0f, -2.0f, -1.0f);
    glm::vec3 direction = to_light ? light - ray.origin : glm::vec3(random.direction());
    if (to_light) ray.t_far = glm::length(direction);
    if (!to_light && direction.z > 0.0f) direction = -direction;
    ray.direction = glm::normalize(direction);
    out.push_back(ray);
  }
  return out;
}

double best_ms(int repetitions, const auto& run) {
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repetitions; ++i) best = std::min(best, double(run()));
  return best;
}

struct Rates {
  double primary, bounced, shadow;  // Mray/s
};

Rates measure_rates(Tracer& tracer, const Scene& scene, uint32_t side, int repetitions) {
  tracer.update(scene, 1, {});
  RayBench bench(tracer);
  const std::vector<TestRay> primary = camera_rays(side, glm::vec3(0.0f));
  const std::vector<TestHit> hits = bench.closest(primary);
  const std::vector<TestRay> bounced = from_hits(primary, hits, false), shadow = from_hits(primary, hits, true);
  const auto rate = [&](const std::vector<TestRay>& rays, bool any, bool coherent) {
    return double(rays.size()) / 1e3 / bench.trace_ms(rays, any, coherent, repetitions);
  };
  return {rate(primary, false, true), rate(bounced, false, false), rate(shadow, true, false)};
}

struct Updates {
  double first, moved, added, deformed;  // milliseconds
};

Updates measure_updates(Tracer& tracer, int repetitions) {
  Scene scene = instanced_world(3, 10000, 40.0);
  const uint32_t big = scene.add_mesh(sphere(160));  // 102 k triangles
  scene.add_instance(place(big));
  const auto update_ms = [&] {
    const double start = now_ms();
    tracer.update(scene, 1, {});
    return now_ms() - start;
  };
  Random random(4);
  Updates ms{};
  ms.first = update_ms();
  ms.moved = best_ms(repetitions, [&] {
    scene.set_instance_pose(5, pose({1.0, 2.0, 3.0 + now_ms() * 1e-9}));
    return update_ms();
  });
  ms.added = best_ms(repetitions, [&] {
    scene.add_instance(place(0, pose({1.0, 2.0, 3.0})));
    return update_ms();
  });
  ms.deformed = best_ms(repetitions + 1, [&] {
    shake(scene, big, random, 1e-4);
    return update_ms();
  });
  return ms;
}

int run(uint32_t side, int repetitions) {
  std::printf("device: %s, %s\n", test_device()->info().name, test_device()->info().driver);
  std::vector<std::unique_ptr<Tracer>> tracers;
  tracers.push_back(make_compute_tracer(test_device()));  // what the others are measured by
  if (test_device()->is_cpu()) tracers.push_back(make_embree_tracer(test_device()));
  if (test_device()->info().capabilities & KS_CAP_RAY_TRACING_PIPELINE) tracers.push_back(make_rt_tracer(test_device()));

  const Scene scene = table_top();
  std::printf("Mray/s       %10s %10s %10s   over compute\n", "primary", "bounced", "shadow");
  Rates base{};
  for (const auto& tracer : tracers) {
    const Rates r = measure_rates(*tracer, scene, side, repetitions);
    if (tracer == tracers.front()) base = r;
    std::printf("%-12s %10.2f %10.2f %10.2f   %.2f %.2f %.2f\n", tracer->name(), r.primary, r.bounced, r.shadow, r.primary / base.primary,
                r.bounced / base.bounced, r.shadow / base.shadow);
  }
  std::printf("update, ms   %10s %10s %10s %10s   (10 k instances; the mesh deformed has 102 k triangles)\n", "first", "one moved",
              "one added", "deformed");
  for (const auto& tracer : tracers) {
    const Updates ms = measure_updates(*tracer, repetitions);
    std::printf("%-12s %10.1f %10.2f %10.2f %10.2f\n", tracer->name(), ms.first, ms.moved, ms.added, ms.deformed);
  }
  return 0;
}

}  // namespace
}  // namespace kuafu::test

int main(int argc, char** argv) {
  return kuafu::test::run(argc > 1 ? uint32_t(std::atoi(argv[1])) : 512u, argc > 2 ? std::atoi(argv[2]) : 5);
}
