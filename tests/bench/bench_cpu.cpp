// SPDX-License-Identifier: Apache-2.0
// What the library costs on a CPU device beside a plain program that traces the same rays with Embree packets and shades them, and beside
// the library's own compute tracer. The table-top, infrared, path depth 3, one projector. CPU time over all threads divided by their
// number, so that what else runs on the machine does not count; least of some repetitions. Usage: bench_cpu [repetitions = 5]
#include <ctime>
#include <thread>

#include "plain_tracer.h"
#include "render_bench.h"

namespace bench {
namespace {

struct Job {
  const char* name;
  uint32_t width, height, views, samples;
};
constexpr Job jobs[] = {{"960x540, 1 spp", 960, 540, 1, 1},
                        {"960x540, 8 spp", 960, 540, 1, 8},
                        {"64 x 128x128, 1 spp", 128, 128, 64, 1},
                        {"128x128, 1 spp", 128, 128, 1, 1}};
constexpr uint32_t depth = 3;

double cpu_ms(uint32_t threads, int repetitions, const auto& run) {
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repetitions; ++i) {
    const std::clock_t start = std::clock();
    run();
    best = std::min(best, double(std::clock() - start) * 1e3 / CLOCKS_PER_SEC / threads);
  }
  return best;
}

double mean(const std::vector<float>& image) {
  double sum = 0;
  for (const float v : image) sum += v;
  return sum / double(image.size());
}

int run(int repetitions) {
  kuafu_device device = open_device();
  const ks_device_info info = info_of(device);
  if (info.kind != KS_DEVICE_KIND_CPU) {
    std::printf("%s is no CPU device: Embree has nothing to do there\n", info.name);
    return 0;
  }
  const uint32_t threads = std::thread::hardware_concurrency();
  const TableTop table = table_top(Surfaces::plastic);
  const PlainTracer plain(table);
  kuafu_scene scene = scene_of(table, device);
  {
    Renderer embree(device, KUAFU_TRACER_AUTO), compute(device, KUAFU_TRACER_COMPUTE);
    std::printf("device: %s, %s; %u threads\n%-20s %9s %9s %9s   kuafu/plain  compute/kuafu   means\n", info.name, info.driver, threads,
                "CPU ms per frame", "plain", "kuafu", "compute");
    for (const Job& job : jobs) {
      std::vector<kuafu_camera_desc> cameras;
      for (uint32_t v = 0; v < job.views; ++v) cameras.push_back(camera(job.width, job.height, v, job.views));
      for (Renderer* r : {&embree, &compute}) {
        r->look(cameras, KUAFU_BAND_INFRARED);
        r->settings.samples_per_pixel = job.samples;
        r->settings.max_bounces = depth - 1;
        r->render(scene);
      }
      PlainTracer::Result result;
      double plain_ms = std::numeric_limits<double>::infinity(), embree_ms = plain_ms, compute_ms = plain_ms;
      for (int i = 0; i < repetitions; ++i) {  // in turns: a machine's clock drifts
        plain_ms = std::min(plain_ms, cpu_ms(threads, 1, [&] { result = plain.render(cameras, job.samples, depth, threads); }));
        embree_ms = std::min(embree_ms, cpu_ms(threads, 1, [&] { embree.render(scene); }));
        if (i < 2) compute_ms = std::min(compute_ms, cpu_ms(threads, 1, [&] { compute.render(scene); }));
      }
      std::printf("%-20s %9.2f %9.2f %9.2f   %11.2f  %13.2f   %.5f %.5f\n", job.name, plain_ms, embree_ms, compute_ms, embree_ms / plain_ms,
                  compute_ms / embree_ms, mean(result.image), mean(embree.image()));
      if (&job == jobs) std::printf("  (%.2f rays per pixel; stages of kuafu: %s)\n", result.rays / (960.0 * 540), embree.stages().c_str());
    }
  }
  kuafu_scene_release(scene);
  kuafu_device_release(device);
  return 0;
}

}  // namespace
}  // namespace bench

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  return bench::run(argc > 1 ? std::atoi(argv[1]) : 5);
}
