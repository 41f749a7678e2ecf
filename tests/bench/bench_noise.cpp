// SPDX-License-Identifier: Apache-2.0
// Samples per pixel until the median pixel is 5 % noisy (standard error over its mean): light and BSDF samples weighted
// (the default), beside plain estimators that find light by the BSDF alone or by the lights alone. The table-top under lights with an
// extent. From the variance between independent renders; the mean images must agree. Usage: bench_noise [renders = 24]
#include "render_bench.h"

namespace bench {
namespace {

constexpr uint32_t samples = 4;

void add_lights(kuafu_scene scene, double size_m) {
  kuafu_light_desc window = kuafu_light_desc_init(KUAFU_LIGHT_RECTANGLE);
  window.ir_intensity = float(8 / (size_m * size_m));
  window.size_m[0] = window.size_m[1] = size_m;
  const Pose from = look_at({-3, -2, 4}, {0, 0, 0.3});
  std::memcpy(window.light_to_world, from.data(), sizeof window.light_to_world);
  uint32_t id = 0;
  ok(kuafu_scene_add_light(scene, &window, &id));
  kuafu_light_desc bulb = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
  bulb.radius_m = size_m / 4;
  bulb.ir_intensity = 2;
  bulb.light_to_world[3] = 1.5, bulb.light_to_world[7] = 1, bulb.light_to_world[11] = 2;
  ok(kuafu_scene_add_light(scene, &bulb, &id));
}

struct Noise {
  double mean, needed_samples;
};

Noise measure(Renderer& renderer, kuafu_scene scene, uint32_t sampling, uint32_t renders) {
  renderer.settings.light_sampling = sampling;
  std::vector<double> sum, squares;
  for (uint32_t seed = 0; seed < renders; ++seed) {
    renderer.settings.seed = seed + 1;
    renderer.render(scene);
    const std::vector<float>& image = renderer.image();
    sum.resize(image.size());
    squares.resize(image.size());
    for (size_t i = 0; i < image.size(); ++i) sum[i] += image[i], squares[i] += double(image[i]) * image[i];
  }
  double all = 0;
  std::vector<double> relative_variance;
  for (size_t i = 0; i < sum.size(); ++i) {
    const double mean = sum[i] / renders;
    all += mean / double(sum.size());
    if (mean > 0) relative_variance.push_back((squares[i] - sum[i] * mean) / (renders - 1) / (mean * mean));
  }
  const auto middle = relative_variance.begin() + ptrdiff_t(relative_variance.size() / 2);
  std::nth_element(relative_variance.begin(), middle, relative_variance.end());
  return {all, samples * *middle / (0.05 * 0.05)};
}

}  // namespace
}  // namespace bench

int main(int argc, char** argv) {
  using namespace bench;
  const uint32_t renders = argc > 1 ? uint32_t(std::max(2, std::atoi(argv[1]))) : 24;
  kuafu_device device = open_device();
  std::printf("device: %s\nspp for 5 %%      weighted  BSDF alone  lights alone   times fewer   means\n", info_of(device).name);
  for (const double size_m : {2.0, 0.5, 0.1}) {
    TableTop table = table_top(Surfaces::plastic);
    for (kuafu_material_desc& m : table.materials) m.roughness *= 0.5f;
    table.projector.ir_intensity = 0;
    kuafu_scene scene = scene_of(table, device);
    add_lights(scene, size_m);
    {
      Renderer renderer(device, KUAFU_TRACER_AUTO);
      renderer.look({camera(96, 54)}, KUAFU_BAND_INFRARED);
      renderer.settings.samples_per_pixel = samples;
      renderer.settings.max_bounces = 2;
      const Noise both = measure(renderer, scene, KUAFU_SAMPLING_MIS, renders);
      const Noise bsdf = measure(renderer, scene, KUAFU_SAMPLING_BSDF, renders),
                  lights = measure(renderer, scene, KUAFU_SAMPLING_LIGHTS, renders);
      std::printf("%.1f m lights  %9.0f %11.0f %13.0f   %5.1f %6.1f   %.4f %.4f %.4f\n", size_m, both.needed_samples, bsdf.needed_samples,
                  lights.needed_samples, bsdf.needed_samples / both.needed_samples, lights.needed_samples / both.needed_samples, both.mean,
                  bsdf.mean, lights.mean);
    }
    kuafu_scene_release(scene);
  }
  kuafu_device_release(device);
}
