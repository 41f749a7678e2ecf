// Both tracers on the same rays: Mray/s of primary, bounced and shadow rays, and milliseconds of updates. Prints ratios, which are what to
// trust. Usage: bench_tracers [image side = 512] [repetitions = 5]
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
  tracer.update(scene, 1);
  RayBench bench(tracer);
  const std::vector<TestRay> primary = camera_rays(side, glm::vec3(0.0f));
  const std::vector<TestHit> hits = bench.closest(primary);
  const std::vector<TestRay> bounced = from_hits(primary, hits, false), shadow = from_hits(primary, hits, true);
  const auto rate = [&](const std::vector<TestRay>& rays, bool any, bool coherent) {
    return double(rays.size()) / 1e3 / bench.trace_ms(rays, any, coherent, repetitions);
  };
  return {rate(primary, false, true), rate(bounced, false, false), rate(shadow, true, false)};
}

void measure_updates(Tracer& tracer, int repetitions) {
  Scene scene = instanced_world(3, 10000, 40.0);
  const uint32_t big = scene.add_mesh(sphere(160));  // 102 k triangles
  scene.add_instance(place(big));
  double start = now_ms();
  tracer.update(scene, 1);
  const double first = now_ms() - start;
  const double move = best_ms(repetitions, [&] {
    scene.set_instance_pose(5, pose({1.0, 2.0, 3.0 + now_ms() * 1e-9}));
    start = now_ms();
    tracer.update(scene, 1);
    return now_ms() - start;
  });
  const double add = best_ms(repetitions, [&] {
    scene.add_instance(place(0, pose({1.0, 2.0, 3.0})));
    start = now_ms();
    tracer.update(scene, 1);
    return now_ms() - start;
  });
  std::printf("%-10s first update %7.1f ms   one of 10 k instances moved %6.2f ms   one added %6.2f ms\n", tracer.name(), first, move, add);
}

int run(uint32_t side, int repetitions) {
  std::printf("device: %s\n", test_device()->info().name);
  const Scene scene = table_top();
  const auto embree = make_embree_tracer(test_device()), compute = make_compute_tracer(test_device());
  const Rates a = measure_rates(*embree, scene, side, repetitions), b = measure_rates(*compute, scene, side, repetitions);
  std::printf("%-10s %10s %10s %10s   Mray/s\n", "", "primary", "bounced", "shadow");
  std::printf("%-10s %10.2f %10.2f %10.2f\n", embree->name(), a.primary, a.bounced, a.shadow);
  std::printf("%-10s %10.2f %10.2f %10.2f\n", compute->name(), b.primary, b.bounced, b.shadow);
  std::printf("%-10s %10.2f %10.2f %10.2f\n", "ratio", a.primary / b.primary, a.bounced / b.bounced, a.shadow / b.shadow);
  measure_updates(*embree, repetitions);
  measure_updates(*compute, repetitions);
  return 0;
}

}  // namespace
}  // namespace kuafu::test

int main(int argc, char** argv) {
  return kuafu::test::run(argc > 1 ? uint32_t(std::atoi(argv[1])) : 512u, argc > 2 ? std::atoi(argv[2]) : 5);
}
