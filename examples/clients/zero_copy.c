/* SPDX-License-Identifier: Apache-2.0 */
/* Depth without copies, in C99: kuafu renders the infrared pair of a wall at 1.5 m and a board at 0.8 m under a dot projector, simsense
 * measures depth from it, and the pair never leaves the memory that kuafu rendered it into. The scene is built by calls, not from a file.
 *
 *   cc zero_copy.c $(pkg-config --cflags --libs kuafu simsense) -o zero_copy && ./zero_copy
 *
 * Ends with 0 when both depths are right within 2 %. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "kuafu/kuafu.h"
#include "simsense/simsense.h"

enum { width = 320, height = 240, dot_count = 6000 };
static const double camera_k[9] = {280, 0, 159.5, 0, 280, 119.5, 0, 0, 1}, projector_k[9] = {500, 0, 319.5, 0, 500, 239.5, 0, 0, 1};
static const double baseline_m = 0.05, wall_m = 1.5, board_m = 0.8;

/* Both libraries return a status; the text of the thread's last error has the numbers and what to do. */
static void check(ks_status status, const char* text) {
  if (status < 0) fprintf(stderr, "%s\n", text), exit(1);
}
#define KUAFU(call) check((call), kuafu_last_error())
#define SIMSENSE(call) check((call), simsense_last_error())

/* A square that faces the camera, its centre at (x, y, z). */
static void add_square(kuafu_scene scene, uint32_t material, float x, float y, float z, float half_m) {
  const float positions[12] = {x - half_m, y - half_m, z, x + half_m, y - half_m, z, x + half_m, y + half_m, z, x - half_m, y + half_m, z};
  const uint32_t indices[6] = {0, 2, 1, 0, 3, 2};
  uint32_t mesh_id = 0, instance_id = 0;
  kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
  mesh.positions = positions, mesh.vertex_count = 4;
  mesh.indices = indices, mesh.triangle_count = 2;
  KUAFU(kuafu_scene_add_mesh(scene, &mesh, &mesh_id));
  kuafu_instance_desc instance = kuafu_instance_desc_init(mesh_id);
  instance.materials = &material, instance.material_count = 1;
  KUAFU(kuafu_scene_add_instance(scene, &instance, &instance_id));
}

static void add_projector(kuafu_scene scene) {
  static float dots[dot_count][3]; /* u, v and brightness of each, in a pattern of 640x480 */
  for (int i = 0; i < dot_count; ++i) dots[i][0] = rand() % 6400 / 10.0f, dots[i][1] = rand() % 4800 / 10.0f, dots[i][2] = 6.0f;
  kuafu_light_desc projector = kuafu_light_desc_init(KUAFU_LIGHT_PROJECTOR);
  projector.ir_intensity = 2.0f, projector.light_to_world[3] = baseline_m / 2;
  memcpy(projector.k, projector_k, sizeof projector_k);
  projector.dots = dots[0], projector.dot_count = dot_count, projector.dot_sigma_px = 1.0f;
  projector.pattern_width = 640, projector.pattern_height = 480;
  uint32_t id = 0;
  KUAFU(kuafu_scene_add_light(scene, &projector, &id));
}

static kuafu_scene make_scene(kuafu_device device) {
  kuafu_scene scene = NULL;
  KUAFU(kuafu_scene_create(device, &scene));
  uint32_t material = 0;
  kuafu_material_desc grey = kuafu_material_desc_init();
  grey.base_color[0] = grey.base_color[1] = grey.base_color[2] = 0.5f, grey.specular = 0.0f;
  KUAFU(kuafu_scene_add_material(scene, &grey, &material));
  add_square(scene, material, 0.0f, 0.0f, (float)wall_m, 3.0f);
  add_square(scene, material, 0.1f, 0.05f, (float)board_m, 0.2f);
  add_projector(scene);
  kuafu_environment_desc environment = kuafu_environment_desc_init();
  environment.ir_radiance = 0.02f;
  KUAFU(kuafu_scene_set_environment(scene, &environment));
  return scene;
}

/* Both cameras in one call, [2][height][width] floats, radiance times `scale` as counts. */
static void render_pair(kuafu_device device, kuafu_scene scene, kuafu_buffer pair) {
  kuafu_view_desc views[2] = {kuafu_view_desc_init(), kuafu_view_desc_init()};
  for (int side = 0; side < 2; ++side) {
    views[side].band = KUAFU_BAND_INFRARED;
    views[side].camera.width = width, views[side].camera.height = height;
    memcpy(views[side].camera.k, camera_k, sizeof camera_k);
    views[side].camera.camera_to_world[3] = side * baseline_m;
  }
  const ks_image_desc image = ks_image_desc_packed(KS_FORMAT_F32, 4, (uint64_t[]){2, height, width, 1});
  kuafu_output_desc output = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, pair, image);
  output.scale = 200.0f;
  kuafu_render_desc render = kuafu_render_desc_init();
  render.views = views, render.view_count = 2, render.outputs = &output, render.output_count = 1;
  kuafu_renderer renderer = NULL;
  KUAFU(kuafu_renderer_create(device, NULL, &renderer));
  KUAFU(kuafu_renderer_render(renderer, scene, &render));
  kuafu_renderer_release(renderer);
}

/* Millimetres, uint16 [height][width], from the two halves of the pair's buffer. */
static void measure_depth(simsense_device device, simsense_buffer pair, uint16_t* depth_mm) {
  simsense_rig_desc rig = simsense_rig_desc_init();
  rig.left.width = width, rig.left.height = height, rig.left_to_right[3] = -baseline_m, rig.rectified = 1;
  memcpy(rig.left.k, camera_k, sizeof camera_k), rig.right = rig.left;
  simsense_parameters parameters = simsense_parameters_init();
  parameters.max_disparity = 64, parameters.min_depth_m = 0.2f;
  simsense_engine engine = NULL;
  SIMSENSE(simsense_engine_create(device, &rig, &parameters, &engine));
  const uint64_t shape[2] = {height, width};
  const simsense_image depth = {NULL, depth_mm, ks_image_desc_packed(KS_FORMAT_U16, 2, shape)};
  const simsense_output_desc output = simsense_output_desc_init(SIMSENSE_OUTPUT_DEPTH, depth);
  simsense_compute_desc compute = simsense_compute_desc_init();
  compute.left = compute.right = (simsense_image){pair, NULL, ks_image_desc_packed(KS_FORMAT_F32, 2, shape)};
  compute.right.image.offset_bytes = (uint64_t)width * height * sizeof(float);
  compute.outputs = &output, compute.output_count = 1;
  SIMSENSE(simsense_engine_compute(engine, &compute));
  simsense_engine_release(engine);
}

static int is_near(double measured_mm, double true_m) { return fabs(measured_mm - 1000.0 * true_m) < 20.0 * true_m; }

int main(void) {
  static uint16_t depth_mm[height][width];
  kuafu_device renderer_device = NULL;
  ks_device_info info = ks_device_info_init();
  KUAFU(kuafu_device_create(NULL, &renderer_device));
  KUAFU(kuafu_device_get_info(renderer_device, &info));
  kuafu_scene scene = make_scene(renderer_device);

  /* A GPU's memory is shared as a file descriptor; where the device is the CPU, both libraries see the same host memory. */
  const int is_cpu = info.kind == KS_DEVICE_KIND_CPU;
  const uint64_t size = 2u * width * height * sizeof(float);
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(size, is_cpu ? KS_BUFFER_HOST_VISIBLE : KS_BUFFER_EXPORTABLE);
  kuafu_buffer rendered = NULL;
  ks_buffer_desc shared = ks_buffer_desc_init();
  KUAFU(kuafu_buffer_create(renderer_device, &create, &rendered));
  render_pair(renderer_device, scene, rendered);
  KUAFU(kuafu_buffer_export(rendered, is_cpu ? KS_MEMORY_HOST : KS_MEMORY_OPAQUE_FD, &shared));

  ks_device_desc choice = ks_device_desc_init();
  choice.select = KS_SELECT_UUID;
  memcpy(choice.uuid, info.device_uuid, sizeof choice.uuid);
  simsense_device depth_device = NULL;
  simsense_buffer pair = NULL;
  SIMSENSE(simsense_device_create(&choice, &depth_device));
  SIMSENSE(simsense_buffer_import(depth_device, &shared, &pair));
  measure_depth(depth_device, pair, depth_mm[0]);
  const double at_wall_mm = depth_mm[20][200], at_board_mm = depth_mm[130][200];
  printf("%s: wall %.0f mm, board %.0f mm\n", info.name, at_wall_mm, at_board_mm);

  simsense_buffer_release(pair); /* the importer of host memory goes before its exporter */
  simsense_device_release(depth_device);
  kuafu_buffer_release(rendered), kuafu_scene_release(scene), kuafu_device_release(renderer_device);
  return is_near(at_wall_mm, wall_m) && is_near(at_board_mm, board_m) ? 0 : 1;
}
