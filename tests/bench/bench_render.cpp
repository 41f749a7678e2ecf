// SPDX-License-Identifier: Apache-2.0
// Frames per second of what the renderer is asked for, on any Vulkan device, each beside the target (which is for an NVIDIA H200). Wall
// time from call to return, and the device's own time where its queue has timestamps; least of some repetitions. Usage: bench_render [full
// | small]   small: an eighth of the sides and few environments, to see that it works on a CPU device

#include "render_bench.h"

namespace bench {
namespace {

struct Time {
  double wall_ms, device_ms;
};

Time least(Renderer& renderer, kuafu_scene scene) {
  Time best{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  const double end = now_ms() + 1000;
  for (int i = 0; i < 3 || (i < 200 && now_ms() < end); ++i) {
    const double start = now_ms();
    renderer.render(scene);
    best.wall_ms = std::min(best.wall_ms, now_ms() - start);
    double device = 0;
    for (const auto& [name, ms] : renderer.stage_times())
      if (name != "upload" && name != "acceleration build") device += ms;
    best.device_ms = std::min(best.device_ms, device);
  }
  return best;
}

void print(const std::string& what, const Time& t, uint32_t images, const char* target) {
  std::printf("%-58s %9.2f %9.2f %11.1f   %s\n", what.c_str(), t.wall_ms, t.device_ms, images * 1e3 / t.wall_ms, target);
  std::fflush(stdout);
}

/// The prototype's measure: one view, path depth 3, the projector alone.
void own_and_driver(kuafu_device device, uint32_t divisor) {
  kuafu_scene scene = scene_of(table_top(Surfaces::plastic), device);
  const bool pipelines = (info_of(device).capabilities & KS_CAP_RAY_TRACING_PIPELINE) != 0;
  for (const uint32_t tracer : {KUAFU_TRACER_COMPUTE, KUAFU_TRACER_RT_PIPELINE}) {
    const bool own = tracer == KUAFU_TRACER_COMPUTE;
    if (!own && !pipelines) {
      std::printf("rt pipeline: this device has none\n");
      break;
    }
    Renderer renderer(device, tracer);
    renderer.look({camera(960 / divisor, 540 / divisor)}, KUAFU_BAND_INFRARED);
    renderer.settings.max_bounces = 2;
    for (const uint32_t samples : {1u, 64u}) {
      if (divisor > 1 && samples > 1) continue;
      renderer.settings.samples_per_pixel = samples;
      const char* target =
          own ? (samples == 1 ? "<= 0.65 ms" : "<= 23 ms") : (samples == 1 ? "(prototype: 0.79 ms)" : "(prototype: 49.5 ms)");
      print(std::string(own ? "own tracer" : "rt pipeline") + ", depth 3, " + std::to_string(samples) + " spp", least(renderer, scene), 1,
            target);
    }
  }
  kuafu_scene_release(scene);
}

/// Infrared frames of a table with metal and glass, path depth 8.
void frames(kuafu_device device, uint32_t divisor) {
  kuafu_scene scene = scene_of(table_top(Surfaces::mixed), device);
  Renderer renderer(device, KUAFU_TRACER_AUTO);
  renderer.look({camera(960 / divisor, 540 / divisor)}, KUAFU_BAND_INFRARED);
  renderer.settings.max_bounces = 7;
  renderer.settings.ir_ambient_radiance = 0.002f;
  struct Asked {
    uint32_t samples;
    const char *plain, *denoised;
  };
  for (const Asked& asked : {Asked{2, ">= 500 images/s", ""}, {8, ">= 150 images/s", ">= 130 images/s"}, {128, ">= 28 images/s", ""}}) {
    if (divisor > 1 && asked.samples > 8) continue;
    renderer.settings.samples_per_pixel = asked.samples;
    for (const bool denoise : {false, true}) {
      renderer.settings.denoise = denoise ? KUAFU_DENOISE_ATROUS : KUAFU_DENOISE_NONE;
      const std::string what =
          "infrared, metal and glass, depth 8, " + std::to_string(asked.samples) + " spp" + (denoise ? ", denoised" : "");
      print(what, least(renderer, scene), 1, denoise ? asked.denoised : asked.plain);
      std::printf("    %s\n", renderer.stages().c_str());
    }
  }
  kuafu_scene_release(scene);
}

/// Pairs of small infrared views, each pair into an environment of its own; all share their meshes.
void environments(kuafu_device device, uint32_t divisor) {
  const uint32_t count = divisor == 1 ? 256 : 4;
  const TableTop table = table_top(Surfaces::mixed);
  kuafu_scene scene = scene_of(table, device);
  std::vector<kuafu_camera_desc> cameras;
  for (uint32_t e = 0; e < count; ++e) {
    for (uint32_t i = 0; i < 8; ++i)  // what is its own: eight more balls
      add_instance(scene, 2 + (e + i) % 20, 1 + i, placed({-1.5 + 0.4 * i, -2 + 0.01 * e, 0.2}, 0.1 * e, 0.2), e);
    for (const double x : {-0.025, 0.025}) {
      cameras.push_back(camera(128, 128, e, count));
      double* m = cameras.back().camera_to_world;
      for (int row = 0; row < 3; ++row) m[4 * row + 3] += x * m[4 * row];
    }
  }
  Renderer renderer(device, KUAFU_TRACER_AUTO);
  renderer.look(cameras, KUAFU_BAND_INFRARED, true);
  renderer.settings.samples_per_pixel = 4;
  renderer.settings.max_bounces = 2;
  print(std::to_string(count) + " environments, pairs of 128x128, depth 3, 4 spp", least(renderer, scene), 2 * count, ">= 8000 images/s");
  std::printf("    %s\n", renderer.stages().c_str());
  kuafu_scene_release(scene);
}

}  // namespace
}  // namespace bench

int main(int argc, char** argv) {
  using namespace bench;
  const uint32_t divisor = argc > 1 && std::strcmp(argv[1], "small") == 0 ? 8 : 1;
  kuafu_device device = open_device();
  std::printf("device: %s, %s\n%-58s %9s %9s %11s   target\n", info_of(device).name, info_of(device).driver,
              divisor == 1 ? "960x540" : "120x67, small: targets do not apply", "wall, ms", "stages", "images/s");
  own_and_driver(device, divisor);
  frames(device, divisor);
  environments(device, divisor);
  kuafu_device_release(device);
}
