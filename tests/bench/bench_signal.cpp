// SPDX-License-Identifier: Apache-2.0
// The imagers of one 848x480 pair on one thread: each preset and the whole chain, vectorised and by the scalar reference, medians and their
// ratio.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "cpu/signal/imager.h"
#include "device/thread_pool.h"
#include "ks/image.h"
#include "signal/imager.h"
#include "simsense/reference/imager.h"

namespace {

constexpr uint32_t width = 848, height = 480;

template <class F>
double median_ms(int repeats, F&& f) {
  std::vector<double> times;
  for (int i = 0; i < repeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    f();
    times.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
  std::nth_element(times.begin(), times.begin() + repeats / 2, times.end());
  return times[static_cast<size_t>(repeats / 2)];
}

simsense_signal everything() {
  simsense_signal s = simsense::signal_preset("d435");
  s.speckle_shape = 100, s.speckle_scale = 0.01f, s.speckle_correlation = 0.5f;
  s.prnu = 0.01f, s.dark_current_e_per_s = 20, s.hot_pixel_share = 1e-3f, s.hot_pixel_e_per_s = 1000;
  s.full_well_e = 40000, s.blooming = 0.5f;
  s.dsnu_e = s.read_noise_e = 5, s.row_fixed_e = s.column_fixed_e = s.row_noise_e = s.column_noise_e = 1;
  s.response_exponent = 0.9f;
  return s;
}

void report(const char* name, const simsense_signal& signal, const std::vector<float>& image) {
  const simsense::Imager imager(signal);
  ks::ThreadPool one_thread(1);
  const simsense::ConstPlane plane{reinterpret_cast<const std::byte*>(image.data()), width * sizeof(float), sizeof(float), KS_FORMAT_F32};
  std::vector<uint8_t> counts(image.size());
  const double fast = median_ms(31, [&] {
    for (uint32_t eye = 0; eye < 2; ++eye)
      simsense::cpu::measure(imager, {1, 2, 0, 0, eye}, {plane}, width, height, counts.data(), one_thread);
  });
  const std::vector<double> exact(image.begin(), image.begin() + width * 16);
  const double slow = median_ms(3, [&] { simsense::reference::measure(signal, {1, 2}, exact, width, 16); }) * 2 * height / 16;
  std::printf("%-12s %8.2f ms   reference %10.0f ms   %6.0fx\n", name, fast, slow, slow / fast);
}

}  // namespace

int main() {
  std::vector<float> image(size_t{width} * height);
  for (size_t i = 0; i < image.size(); ++i) image[i] = static_cast<float>((i * 37) % 251);
  simsense_signal gain = simsense_signal_init();
  gain.gain = 1.1f;
  report("gain alone", gain, image);
  for (const char* preset : {"paper-d415", "sapien", "d435"}) report(preset, simsense::signal_preset(preset), image);
  report("everything", everything(), image);
}
