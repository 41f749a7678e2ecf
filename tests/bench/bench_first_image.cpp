// SPDX-License-Identifier: Apache-2.0
// How long a process waits for its first image: 424x240, 1 spp, infrared, of the table-top, from main to the pixels. Each figure is a
// process of its own: cold with empty cache folders (ours and the driver's), warm with those that the cold one left. CPU time, divided by
// the cores, is what an idle machine would show at least.
// Usage: bench_first_image
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "render_bench.h"

namespace bench {
namespace {

struct Kind {
  const char* name;
  uint32_t tracer;
};
constexpr Kind kinds[] = {{"auto", KUAFU_TRACER_AUTO}, {"compute", KUAFU_TRACER_COMPUTE}, {"rt", KUAFU_TRACER_RT_PIPELINE}};

int child(uint32_t tracer) {
  const double start = now_ms();
  kuafu_device device = open_device();
  const double opened = now_ms();
  if (tracer == KUAFU_TRACER_RT_PIPELINE && !(info_of(device).capabilities & KS_CAP_RAY_TRACING_PIPELINE)) return 2;
  kuafu_scene scene = scene_of(table_top(Surfaces::plastic), device);
  const double built = now_ms();
  {
    Renderer renderer(device, tracer);
    renderer.look({camera(424, 240)}, KUAFU_BAND_INFRARED);
    renderer.settings.samples_per_pixel = 1;
    renderer.render(scene);
    (void)renderer.image();
    const double rendered = now_ms(), cpu = cpu_ms();
    renderer.render(scene);
    std::printf("%8.0f %8.0f   %6.0f %6.0f %6.0f   %6.0f\n", rendered - start, cpu, opened - start, built - opened, rendered - built,
                now_ms() - rendered);
  }
  kuafu_scene_release(scene);
  kuafu_device_release(device);
  return 0;
}

/// Ends with the child's exit status.
int run_child(const char* program, const char* kind) {
  std::fflush(stdout);
  const pid_t pid = fork();
  if (pid == 0) {
    execl(program, program, kind, nullptr);
    _exit(127);
  }
  int status = 0;
  waitpid(pid, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

int parent() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  kuafu_device device = open_device();
  std::printf("device: %s, %s\nfirst image, ms    all  all CPU   device  scene  image   the next image\n", info_of(device).name,
              info_of(device).driver);
  kuafu_device_release(device);
  for (const Kind& kind : kinds) {
    char folder[] = "/tmp/bench_first_image_XXXXXX";
    if (!mkdtemp(folder)) return 1;
    for (const char* name : {"XDG_CACHE_HOME", "MESA_SHADER_CACHE_DIR", "CUDA_CACHE_PATH", "__GL_SHADER_DISK_CACHE_PATH"})
      setenv(name, folder, 1);
    int status = 0;
    for (const char* state : {"cold", "warm"}) {
      std::printf("%-7s %s ", kind.name, state);
      status = run_child(program.c_str(), kind.name);
      if (status == 2) std::printf("the device has no ray tracing pipelines\n");
      if (status != 0) break;
    }
    std::filesystem::remove_all(folder, error);
    if (status != 0 && status != 2) return status;
  }
  return 0;
}

}  // namespace
}  // namespace bench

int main(int argc, char** argv) {
  for (const bench::Kind& kind : bench::kinds)
    if (argc == 2 && std::strcmp(argv[1], kind.name) == 0) return bench::child(kind.tracer);
  return bench::parent();
}
