// A host that forks goes on, and so does its child; descriptors that are no memory are refused.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>

#include "capi/library_pair.h"

namespace ks::test {
namespace {

/// A device, and a small render.
struct SmallRender {
  kuafu_device device = open_cpu_device<Kuafu>();
  kuafu_scene scene = nullptr;
  kuafu_renderer renderer = nullptr;
  kuafu_buffer buffer = nullptr;
  kuafu_view_desc view = kuafu_view_desc_init();
  kuafu_output_desc output{};
  kuafu_render_desc desc = kuafu_render_desc_init();

  explicit SmallRender(uint32_t tracer) {
    if (device == nullptr) return;
    constexpr uint32_t side = 64;
    const float positions[] = {-9, -9, 2, 9, -9, 2, -9, 9, 2};
    const uint32_t indices[] = {0, 1, 2};
    kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
    mesh.positions = positions, mesh.vertex_count = 3, mesh.indices = indices, mesh.triangle_count = 1;
    kuafu_instance_desc instance = kuafu_instance_desc_init(0);
    kuafu_environment_desc environment = kuafu_environment_desc_init();
    for (float& r : environment.radiance) r = 1.0f;
    kuafu_renderer_desc renderer_desc{};
    renderer_desc.header = ks_header_make(KUAFU_TYPE_RENDERER_DESC, sizeof renderer_desc);
    renderer_desc.tracer = tracer;
    const ks_buffer_create create = ks_buffer_create_init(side * side * 4, KS_BUFFER_HOST_VISIBLE);
    uint32_t id = 0;
    EXPECT_EQ(kuafu_scene_create(device, &scene), KS_OK);
    EXPECT_EQ(kuafu_scene_add_mesh(scene, &mesh, &instance.mesh), KS_OK) << kuafu_last_error();
    EXPECT_EQ(kuafu_scene_add_instance(scene, &instance, &id), KS_OK) << kuafu_last_error();
    EXPECT_EQ(kuafu_scene_set_environment(scene, &environment), KS_OK);
    EXPECT_EQ(kuafu_renderer_create(device, &renderer_desc, &renderer), KS_OK) << kuafu_last_error();
    EXPECT_EQ(kuafu_buffer_create(device, &create, &buffer), KS_OK);
    view.camera.width = view.camera.height = side;
    view.camera.k[0] = view.camera.k[4] = 60, view.camera.k[2] = view.camera.k[5] = 31.5;
    const uint64_t shape[4] = {1, side, side, 1};
    output = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, buffer, ks_image_desc_packed(KS_FORMAT_F32, 4, shape));
    view.band = KUAFU_BAND_INFRARED;
    desc.views = &view, desc.view_count = 1, desc.outputs = &output, desc.output_count = 1;
    desc.samples_per_pixel = 1;
  }
  ~SmallRender() {
    kuafu_buffer_release(buffer);
    kuafu_renderer_release(renderer);
    kuafu_scene_release(scene);
    kuafu_device_release(device);
  }
  SmallRender(const SmallRender&) = delete;
  SmallRender& operator=(const SmallRender&) = delete;

  /// A short render works.
  void expect_works() { EXPECT_EQ(kuafu_renderer_render(renderer, scene, &desc), KS_OK) << kuafu_last_error(); }
};

class Fork : public testing::TestWithParam<uint32_t> {};

TEST_P(Fork, AForkedChildMayReleaseAndIsToldWhatItCannotUse) {
  SmallRender render(GetParam());
  SKIP_IF(render.device ? "" : kuafu_last_error());
  render.expect_works();
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);
    const bool refused = kuafu_renderer_render(render.renderer, render.scene, &render.desc) == KS_ERROR_INVALID_STATE &&
                         std::strstr(kuafu_last_error(), "before fork") != nullptr;
    kuafu_buffer_release(render.buffer);
    kuafu_renderer_release(render.renderer);
    kuafu_scene_release(render.scene);
    kuafu_device_release(render.device);
    _exit(refused ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  render.expect_works();
}

INSTANTIATE_TEST_SUITE_P(Tracers, Fork, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE));

TEST(BufferImport, APipeOrASocketIsNoMemory) {
  const kuafu_device device = open_cpu_device<Kuafu>();
  SKIP_IF(device ? "" : kuafu_last_error());
  ks_device_info info = ks_device_info_init();
  ASSERT_EQ(kuafu_device_get_info(device, &info), KS_OK);
  int ends[2], sockets[2];
  ASSERT_EQ(pipe(ends), 0);
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_STREAM, 0, sockets), 0);
  for (const int fd : {ends[0], sockets[0]}) {
    ks_buffer_desc desc = ks_buffer_desc_init();
    desc.memory = KS_MEMORY_OPAQUE_FD;
    desc.handle = static_cast<uint64_t>(fd);
    desc.size_bytes = desc.allocation_bytes = 4096;
    std::memcpy(desc.device_uuid, info.device_uuid, sizeof desc.device_uuid);
    std::memcpy(desc.driver_uuid, info.driver_uuid, sizeof desc.driver_uuid);
    kuafu_buffer buffer = nullptr;
    EXPECT_EQ(kuafu_buffer_import(device, &desc, &buffer), KS_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(std::strstr(kuafu_last_error(), "not memory"), nullptr) << kuafu_last_error();
  }
  for (const int fd : {ends[0], ends[1], sockets[0], sockets[1]}) close(fd);
  kuafu_device_release(device);
}

}  // namespace
}  // namespace ks::test
