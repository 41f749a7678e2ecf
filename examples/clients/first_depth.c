/* SPDX-License-Identifier: Apache-2.0 */
/* The first depth map in C99: kuafu renders the infrared pair of a scene under a dot projector, and simsense measures depth from it.
 *   cc first_depth.c $(pkg-config --cflags --libs kuafu simsense) -o first_depth && ./first_depth wall_and_board.obj */
#include <stdio.h>
#include <stdlib.h>

#include "kuafu/kuafu.h"
#include "simsense/simsense.h"
enum { width = 320, height = 240, dot_count = 6000 };
static const double camera_k[9] = {280, 0, 159.5, 0, 280, 119.5, 0, 0, 1}, projector_k[9] = {500, 0, 319.5, 0, 500, 239.5, 0, 0, 1};
static const double baseline_m = 0.05;
static float pair[2][height][width], depth_m[height][width];

/* Both libraries return a status; the text of the thread's last error has the numbers and what to do. */
static void check(ks_status status, const char* text) {
  if (status < 0) fprintf(stderr, "%s\n", text), exit(1);
}
#define KUAFU(call) check((call), kuafu_last_error())
#define SIMSENSE(call) check((call), simsense_last_error())

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

static void render_pair(const char* scene_file) {
  kuafu_device device = NULL;
  kuafu_scene scene = NULL;
  kuafu_renderer renderer = NULL;
  kuafu_buffer buffer = NULL;
  KUAFU(kuafu_device_create(NULL, &device));
  KUAFU(kuafu_scene_create(device, &scene));
  KUAFU(kuafu_scene_load(scene, scene_file, NULL, NULL));
  add_projector(scene);
  kuafu_view_desc views[2] = {kuafu_view_desc_init(), kuafu_view_desc_init()};
  for (int side = 0; side < 2; ++side) {
    views[side].band = KUAFU_BAND_INFRARED;
    views[side].camera.width = width, views[side].camera.height = height;
    memcpy(views[side].camera.k, camera_k, sizeof camera_k);
    views[side].camera.camera_to_world[3] = side * baseline_m;
  }
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(sizeof pair, KS_BUFFER_HOST_VISIBLE);
  KUAFU(kuafu_buffer_create(device, &create, &buffer));
  const ks_image_desc image = ks_image_desc_packed(KS_FORMAT_F32, 4, (uint64_t[]){2, height, width, 1});
  kuafu_output_desc output = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, buffer, image);
  output.scale = 200.0f; /* counts per W/(sr m^2) */
  kuafu_render_desc render = kuafu_render_desc_init();
  render.views = views, render.view_count = 2, render.outputs = &output, render.output_count = 1;
  KUAFU(kuafu_renderer_create(device, NULL, &renderer));
  KUAFU(kuafu_renderer_render(renderer, scene, &render));
  KUAFU(kuafu_buffer_read(buffer, 0, pair, sizeof pair));
  kuafu_renderer_release(renderer), kuafu_buffer_release(buffer), kuafu_scene_release(scene), kuafu_device_release(device);
}

int main(int count, char** arguments) {
  render_pair(count > 1 ? arguments[1] : "wall_and_board.obj");
  simsense_device device = NULL;
  simsense_engine engine = NULL;
  simsense_rig_desc rig = simsense_rig_desc_init();
  const simsense_parameters parameters = simsense_parameters_init();
  rig.left.width = width, rig.left.height = height, rig.left_to_right[3] = -baseline_m, rig.rectified = 1;
  memcpy(rig.left.k, camera_k, sizeof camera_k), rig.right = rig.left;
  SIMSENSE(simsense_device_create(NULL, &device));
  SIMSENSE(simsense_engine_create(device, &rig, &parameters, &engine));
  const ks_image_desc image = ks_image_desc_packed(KS_FORMAT_F32, 2, (uint64_t[]){height, width});
  const simsense_output_desc output = simsense_output_desc_init(SIMSENSE_OUTPUT_DEPTH, (simsense_image){NULL, depth_m, image});
  simsense_compute_desc compute = simsense_compute_desc_init();
  compute.left = (simsense_image){NULL, pair[0], image}, compute.right = (simsense_image){NULL, pair[1], image};
  compute.outputs = &output, compute.output_count = 1;
  SIMSENSE(simsense_engine_compute(engine, &compute));
  printf("wall %.2f m, board %.2f m\n", depth_m[20][200], depth_m[130][200]);
  simsense_engine_release(engine), simsense_device_release(device);
}
