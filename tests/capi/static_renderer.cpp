// SPDX-License-Identifier: Apache-2.0
// Run by CTest: a host keeps a renderer in a static that is there before the library opens Embree, and so outlives it. The program ends by
// itself, with a render under way; one that begins so late is refused. Exits 0 when every expectation holds.
#include <array>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "kuafu/kuafu.hpp"

namespace {

constexpr uint32_t side = 16, hours = 100000000;  // pixels; samples

struct Kept {
  kuafu::Device device;
  kuafu::Scene scene{device};
  kuafu::Buffer buffer{device, side* side * sizeof(float), KS_BUFFER_HOST_VISIBLE};
  kuafu::Renderer renderer;

  explicit Kept(const kuafu_renderer_desc& desc) : renderer(device, &desc) {
    const std::array<float, 9> positions{-9, -9, 2, 9, -9, 2, -9, 9, 2};
    const std::array<uint32_t, 3> indices{0, 1, 2};
    kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
    mesh.positions = positions.data(), mesh.vertex_count = 3, mesh.indices = indices.data(), mesh.triangle_count = 1;
    kuafu_instance_desc instance = kuafu_instance_desc_init(1);
    uint32_t id = 0;
    kuafu::check(kuafu_scene_add_mesh(scene, &mesh, &instance.mesh));
    kuafu::check(kuafu_scene_add_instance(scene, &instance, &id));
  }
  ~Kept() {
    kuafu_renderer_cancel(renderer);
    if (render(1) == KS_ERROR_INVALID_STATE) return;
    std::fputs("FAILED: a render after the end of Embree is not refused\n", stderr);
    std::_Exit(1);
  }
  Kept(const Kept&) = delete;
  Kept& operator=(const Kept&) = delete;

  /// samples: of one render that is waited for, or `hours` of one that is not.
  ks_status render(uint32_t samples) {
    kuafu_view_desc view = kuafu_view_desc_init();
    view.camera.width = view.camera.height = side;
    view.camera.k[0] = view.camera.k[4] = side, view.camera.k[2] = view.camera.k[5] = side / 2 - 0.5;
    const std::array<uint64_t, 4> shape{1, side, side, 1};
    const auto output = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, buffer, ks_image_desc_packed(KS_FORMAT_F32, 4, shape.data()));
    kuafu_render_desc desc = kuafu_render_desc_init();
    view.band = KUAFU_BAND_INFRARED;
    desc.views = &view, desc.view_count = 1, desc.outputs = &output, desc.output_count = 1, desc.samples_per_pixel = samples;
    ks_sync submission = ks_sync_init();
    return samples == hours ? kuafu_renderer_submit(renderer, scene, &desc, &submission) : kuafu_renderer_render(renderer, scene, &desc);
  }
};

std::unique_ptr<Kept> kept;

}  // namespace

int main() try {
  kuafu_renderer_desc embree = kuafu_renderer_desc_init();
  embree.tracer = KUAFU_TRACER_EMBREE;
  kept = std::make_unique<Kept>(embree);
  kuafu::check(kept->render(1));
  kuafu::check(kept->render(hours));
  return 0;
} catch (const ks::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
