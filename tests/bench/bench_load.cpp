// SPDX-License-Identifier: Apache-2.0
// What it costs to read a scene file in another process: times of loading each file again and again into a new scene. Of a file of a few
// hundred bytes nearly all is the helper program's start, its answer and its end. The processor time, of both processes, is what an idle
// machine would need at most.
// Usage: bench_load FILE...
#include <sys/resource.h>

#include <algorithm>
#include <vector>

#include "render_bench.h"

namespace bench {
namespace {

constexpr size_t loads = 50;

double cpu_ms() {
  double ms = 0;
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage used{};
    getrusage(who, &used);
    for (const timeval& t : {used.ru_utime, used.ru_stime}) ms += 1e3 * double(t.tv_sec) + 1e-3 * double(t.tv_usec);
  }
  return ms;
}

double load_ms(kuafu_device device, const char* path) {
  kuafu_scene scene = nullptr;
  ok(kuafu_scene_create(device, &scene));
  const double start = now_ms();
  ok(kuafu_scene_load(scene, path, nullptr));
  const double ms = now_ms() - start;
  kuafu_scene_release(scene);
  return ms;
}

}  // namespace
}  // namespace bench

int main(int argc, char** argv) {
  using namespace bench;
  const kuafu_device device = open_device();
  std::printf("one load, ms: first  median  largest of %zu  processor\n", loads);
  for (int i = 1; i < argc; ++i) {
    const double first = load_ms(device, argv[i]);
    std::vector<double> ms(loads);
    const double before = cpu_ms();
    for (double& one : ms) one = load_ms(device, argv[i]);
    const double cpu = (cpu_ms() - before) / loads;
    std::sort(ms.begin(), ms.end());
    std::printf("             %6.1f  %6.1f  %13.1f  %9.1f  %s\n", first, ms[loads / 2], ms.back(), cpu, argv[i]);
  }
  kuafu_device_release(device);
  return 0;
}
