// SPDX-License-Identifier: Apache-2.0
// How long a caller who cancels waits: from the wish in another thread to the end of the render call. Three phases of each tracer: the
// first image of a process (pipelines are compiled: the driver's own cache is off), the tree of a mesh of two million triangles, and a
// long render of the table-top at 848x480.
// Usage: bench_cancel
#include <algorithm>
#include <atomic>
#include <thread>

#include "render_bench.h"

namespace bench {
namespace {

struct Kind {
  const char* name;
  uint32_t tracer;
};
constexpr Kind kinds[] = {{"embree", KUAFU_TRACER_EMBREE}, {"compute", KUAFU_TRACER_COMPUTE}};

/// Milliseconds from the wish, so long after the start, to the end; negative where the render had ended before.
double latency_ms(Renderer& renderer, kuafu_scene scene, int delay_ms) {
  std::atomic<bool> wish{false};
  std::atomic<double> wished_ms{0};
  renderer.settings.progress = [](void* wanted, float) -> int32_t { return static_cast<std::atomic<bool>*>(wanted)->load() ? 1 : 0; };
  renderer.settings.progress_user = &wish;
  std::thread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(delay_ms));
    wished_ms = now_ms();
    wish = true;
  });
  const ks_status status = renderer.try_render(scene);
  const double end_ms = now_ms();
  other.join();
  return status == KS_ERROR_CANCELLED ? end_ms - wished_ms : -1.0;
}

void print(const char* tracer, const char* phase, std::vector<double> latencies) {
  std::erase_if(latencies, [](double ms) { return ms < 0; });
  std::ranges::sort(latencies);
  if (latencies.empty()) return (void)std::printf("%-8s %-12s ended before\n", tracer, phase);
  std::printf("%-8s %-12s %7.0f %7.0f   of %zu\n", tracer, phase, latencies[latencies.size() / 2], latencies.back(), latencies.size());
}

/// A bumpy sheet of 2 * side^2 triangles.
kuafu_scene large_mesh(kuafu_device device, uint32_t side) {
  Shape sheet;
  for (uint32_t y = 0; y <= side; ++y)
    for (uint32_t x = 0; x <= side; ++x) {
      const float u = float(x) / float(side), v = float(y) / float(side);
      sheet.positions.insert(sheet.positions.end(), {u, v, 0.02f * std::sin(40 * u) * std::cos(31 * v)});
    }
  for (uint32_t y = 0; y < side; ++y)
    for (uint32_t x = 0; x < side; ++x) {
      const uint32_t a = y * (side + 1) + x, b = a + side + 1;
      sheet.indices.insert(sheet.indices.end(), {a, a + 1, b, b, a + 1, b + 1});
    }
  kuafu_scene scene = nullptr;
  ok(kuafu_scene_create(device, &scene));
  const kuafu_instance_desc instance = kuafu_instance_desc_init(add_shape(scene, sheet));
  uint32_t id = 0;
  ok(kuafu_scene_add_instance(scene, &instance, &id));
  return scene;
}

void measure(kuafu_device device, const Kind& kind) {
  kuafu_scene scene = scene_of(table_top(Surfaces::plastic), device);
  std::vector<double> first, tree, running;
  for (const int delay_ms : {20, 300, 800, 1500, 2500, 4000}) {
    Renderer renderer(device, kind.tracer);
    renderer.look({camera(424, 240)}, KUAFU_BAND_INFRARED);
    renderer.settings.samples_per_pixel = 100000;
    first.push_back(latency_ms(renderer, scene, delay_ms));
  }
  print(kind.name, "first image", first);
  kuafu_scene sheet = large_mesh(device, 1000);
  for (const int delay_ms : {20, 60, 120, 250, 400, 700, 1000, 1500}) {
    Renderer renderer(device, kind.tracer);
    renderer.look({camera(64, 48)}, KUAFU_BAND_INFRARED);
    renderer.settings.samples_per_pixel = 100000;
    tree.push_back(latency_ms(renderer, sheet, delay_ms));
  }
  print(kind.name, "large mesh", tree);
  {
    Renderer renderer(device, kind.tracer);
    renderer.look({camera(848, 480)}, KUAFU_BAND_INFRARED);
    renderer.settings.samples_per_pixel = 1;
    renderer.render(scene);
    renderer.settings.samples_per_pixel = 100000;
    for (int i = 0; i < 20; ++i) running.push_back(latency_ms(renderer, scene, 200 + 37 * i));
  }
  print(kind.name, "long render", running);
  kuafu_scene_release(sheet);
  kuafu_scene_release(scene);
}

}  // namespace
}  // namespace bench

int main() {
  setenv("MESA_SHADER_CACHE_DISABLE", "true", 1);
  ks_device_desc desc = ks_device_desc_init();
  desc.cache_directory = "";
  kuafu_device device = nullptr;
  bench::ok(kuafu_device_create(&desc, &device));
  std::printf("milliseconds from the wish to the end: median and most\n");
  for (const bench::Kind& kind : bench::kinds) bench::measure(device, kind);
  kuafu_device_release(device);
}
