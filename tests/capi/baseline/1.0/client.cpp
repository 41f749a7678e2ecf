// The first depth map in C++17, with kuafu.hpp and simsense.hpp: an infrared pair of a wall at 1.5 m and a board at 0.8 m under a dot
// projector, and the depth that simsense measures in the memory kuafu rendered into. Built as examples/clients/CMakeLists.txt says.
// Ends with 0 when both depths are right within 2 %.
#include <array>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "kuafu/kuafu.hpp"
#include "simsense/simsense.hpp"

namespace {

constexpr uint32_t width = 320, height = 240;
constexpr std::array<double, 9> camera_k{280, 0, 159.5, 0, 280, 119.5, 0, 0, 1};
constexpr double baseline_m = 0.05, wall_m = 1.5, board_m = 0.8;

/// A square that faces the camera, its centre at (x, y, z).
void add_square(const kuafu::Scene& scene, uint32_t material, float x, float y, float z, float half_m) {
  const std::array positions{x - half_m, y - half_m, z, x + half_m, y - half_m, z, x + half_m, y + half_m, z, x - half_m, y + half_m, z};
  const std::array<uint32_t, 6> indices{0, 2, 1, 0, 3, 2};
  auto mesh = kuafu_mesh_desc_init();
  mesh.positions = positions.data();
  mesh.indices = indices.data();
  mesh.vertex_count = 4;
  mesh.triangle_count = 2;
  uint32_t mesh_id = 0, instance_id = 0;
  kuafu::check(kuafu_scene_add_mesh(scene, &mesh, &mesh_id));
  auto instance = kuafu_instance_desc_init(mesh_id);
  instance.materials = &material;
  instance.material_count = 1;
  kuafu::check(kuafu_scene_add_instance(scene, &instance, &instance_id));
}

void add_projector(const kuafu::Scene& scene) {
  std::minstd_rand random(1);
  const auto below = [&](float limit) { return limit * float(random() - 1) / float(std::minstd_rand::max()); };
  std::vector<float> dots;
  for (int i = 0; i < 6000; ++i) {
    const float u = below(640), v = below(480);
    dots.insert(dots.end(), {u, v, 6.0f});
  }
  auto light = kuafu_light_desc_init(KUAFU_LIGHT_PROJECTOR);
  light.ir_intensity = 2;
  light.light_to_world[3] = baseline_m / 2;
  light.k[0] = light.k[4] = 500;
  light.k[2] = 319.5;
  light.k[5] = 239.5;
  light.dots = dots.data();
  light.dot_count = uint32_t(dots.size() / 3);
  light.pattern_width = 640;
  light.pattern_height = 480;
  light.dot_sigma_px = 1;
  uint32_t id = 0;
  kuafu::check(kuafu_scene_add_light(scene, &light, &id));
}

kuafu::Scene make_scene(const kuafu::Device& device) {
  kuafu::Scene scene(device);
  auto grey = kuafu_material_desc_init();
  grey.base_color[0] = grey.base_color[1] = grey.base_color[2] = 0.5f;
  grey.specular = 0;
  uint32_t material = 0;
  kuafu::check(kuafu_scene_add_material(scene, &grey, &material));
  add_square(scene, material, 0, 0, float(wall_m), 3);
  add_square(scene, material, 0.1f, 0.05f, float(board_m), 0.2f);
  add_projector(scene);
  auto environment = kuafu_environment_desc_init();
  environment.ir_radiance = 0.02f;
  kuafu::check(kuafu_scene_set_environment(scene, &environment));
  return scene;
}

void render_pair(const kuafu::Device& device, const kuafu::Scene& scene, const kuafu::Buffer& pair) {
  const std::array<uint64_t, 4> shape{2, height, width, 1};
  std::array<kuafu_view_desc, 2> views{};
  for (size_t side = 0; side < 2; ++side) {
    views[side] = kuafu_view_desc_init();
    views[side].band = KUAFU_BAND_INFRARED;
    kuafu_camera_desc& camera = views[side].camera;
    camera.width = width;
    camera.height = height;
    std::copy(camera_k.begin(), camera_k.end(), camera.k);
    camera.camera_to_world[3] = double(side) * baseline_m;
  }
  auto output = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, pair, ks_image_desc_packed(KS_FORMAT_F32, 4, shape.data()));
  output.scale = 200;  // counts per W/(sr m^2)
  auto render = kuafu_render_desc_init();
  render.views = views.data();
  render.view_count = 2;
  render.outputs = &output;
  render.output_count = 1;
  const kuafu::Renderer renderer(device);
  kuafu::check(kuafu_renderer_render(renderer, scene, &render));
}

std::vector<uint16_t> measure_depth_mm(const simsense::Device& device, const simsense::Buffer& pair) {
  const std::array<uint64_t, 2> shape{height, width};
  auto rig = simsense_rig_desc_init();
  rig.left.width = width;
  rig.left.height = height;
  std::copy(camera_k.begin(), camera_k.end(), rig.left.k);
  rig.right = rig.left;
  rig.left_to_right[3] = -baseline_m;
  rig.rectified = 1;
  auto parameters = simsense_parameters_init();
  parameters.max_disparity = 64;
  parameters.min_depth_m = 0.2f;
  const simsense::Engine engine(device, rig, parameters);
  std::vector<uint16_t> depth_mm(size_t{width} * height);
  simsense_output_desc output{};
  output.header = ks_header_make(SIMSENSE_TYPE_OUTPUT_DESC, sizeof output);
  output.output = SIMSENSE_OUTPUT_DEPTH;
  output.image.host = depth_mm.data();
  output.image.image = ks_image_desc_packed(KS_FORMAT_U16, 2, shape.data());
  auto compute = simsense_compute_desc_init();
  compute.left.buffer = compute.right.buffer = pair;
  compute.left.image = compute.right.image = ks_image_desc_packed(KS_FORMAT_F32, 2, shape.data());
  compute.right.image.offset_bytes = uint64_t{width} * height * sizeof(float);
  compute.outputs = &output;
  compute.output_count = 1;
  simsense::check(simsense_engine_compute(engine, &compute));
  return depth_mm;
}

bool is_near(double measured_mm, double true_m) { return std::abs(measured_mm - 1000 * true_m) < 20 * true_m; }

}  // namespace

int main() {
  try {
    const kuafu::Device renderer_device;
    const ks_device_info info = renderer_device.info();
    const bool host = info.kind == KS_DEVICE_KIND_CPU;
    const kuafu::Buffer rendered(renderer_device, 2u * width * height * sizeof(float),
                                 host ? KS_BUFFER_HOST_VISIBLE : KS_BUFFER_EXPORTABLE);
    render_pair(renderer_device, make_scene(renderer_device), rendered);

    auto choice = ks_device_desc_init();
    choice.select = KS_SELECT_UUID;
    std::copy(std::begin(info.device_uuid), std::end(info.device_uuid), choice.uuid);
    const simsense::Device depth_device(choice);
    const simsense::Buffer pair(depth_device, rendered.export_as(host ? KS_MEMORY_HOST : KS_MEMORY_OPAQUE_FD));
    const std::vector<uint16_t> depth_mm = measure_depth_mm(depth_device, pair);

    const double wall_mm = depth_mm[20 * width + 200], board_mm = depth_mm[130 * width + 200];
    std::printf("%s: wall %.0f mm, board %.0f mm\n", info.name, wall_mm, board_mm);
    return is_near(wall_mm, wall_m) && is_near(board_mm, board_m) ? 0 : 1;
  } catch (const ks::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
