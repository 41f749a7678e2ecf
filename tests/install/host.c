/* SPDX-License-Identifier: Apache-2.0 */
/* A host program that has names of its own for what other libraries export (stubs.s, made by the test), opens both libraries at run time
 * with RTLD_LOCAL, and works with the tables of their functions: a scene file by Embree, and depth from a pair that needs rectification.
 * Usage: host LIBKUAFU LIBSIMSENSE SCENE. Ends with 0 when no call of theirs came to its own names and the results are right. */
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "kuafu/api.h"
#include "simsense/api.h"

/* Where every stub jumps. */
void taken_over(const char* name);
void taken_over(const char* name) {
  fprintf(stderr, "a call to %s came to the host's own function\n", name);
  fflush(stderr);
  _exit(3);
}

static void check(ks_status status, const char* text) {
  if (status >= 0) return;
  fprintf(stderr, "%s: %s\n", ks_status_name(status), text);
  exit(1);
}

static void* table_of(const char* path, const char* function) {
  void* library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  void* get = library ? dlsym(library, function) : NULL;
  if (!get) {
    fprintf(stderr, "%s\n", dlerror());
    exit(1);
  }
  return get;
}

/* Depth of the scene before the camera, by Embree. */
static void render(const kuafu_api* api, const char* scene_path) {
  const uint64_t shape[4] = {1, 48, 64, 1};
  kuafu_device device = NULL;
  kuafu_scene scene = NULL;
  kuafu_renderer renderer = NULL;
  kuafu_buffer buffer = NULL;
  ks_device_desc choice = ks_device_desc_init();
  ks_buffer_create_desc create = ks_buffer_create_desc_init(48 * 64 * 4, KS_BUFFER_HOST_VISIBLE);
  kuafu_renderer_desc desc;
  kuafu_view_desc view = kuafu_view_desc_init();
  kuafu_render_desc render = kuafu_render_desc_init();
  kuafu_output_desc output;
  float depth[48 * 64];
  choice.select = KS_SELECT_CPU;
  check(api->device_create(&choice, &device), api->last_error());
  check(api->scene_create(device, &scene), api->last_error());
  check(api->scene_load(scene, scene_path, NULL, NULL), api->last_error());
  memset(&desc, 0, sizeof desc);
  desc.header = ks_header_make(KUAFU_TYPE_RENDERER_DESC, (uint32_t)sizeof desc);
  desc.tracer = KUAFU_TRACER_EMBREE;
  check(api->renderer_create(device, &desc, &renderer), api->last_error());
  check(api->buffer_create(device, &create, &buffer), api->last_error());
  view.camera.width = 64;
  view.camera.height = 48;
  view.camera.k[0] = view.camera.k[4] = 60;
  view.camera.k[2] = 31.5;
  view.camera.k[5] = 23.5;
  output = kuafu_output_desc_init(KUAFU_OUTPUT_DEPTH, buffer, ks_image_desc_packed(KS_FORMAT_F32, 4, shape));
  render.views = &view;
  render.view_count = 1;
  render.outputs = &output;
  render.output_count = 1;
  render.samples_per_pixel = 1;
  check(api->renderer_render(renderer, scene, &render), api->last_error());
  check(api->buffer_read(buffer, 0, depth, sizeof depth), api->last_error());
  if (fabsf(depth[24 * 64 + 32] - 2.0f) > 1e-3f) {
    fprintf(stderr, "the wall at 2 m is seen at %g m\n", depth[24 * 64 + 32]);
    exit(1);
  }
  api->buffer_release(buffer);
  api->renderer_release(renderer);
  api->scene_release(scene);
  api->device_release(device);
}

/* A pair with distortion and a tilted right camera, so that everything about rectification runs. */
static void match(const simsense_api* api) {
  enum { width = 128, height = 96 };
  const uint64_t shape[2] = {height, width};
  static uint8_t image[width * height];
  static float disparity[width * height];
  simsense_device device = NULL;
  simsense_engine engine = NULL;
  ks_device_desc choice = ks_device_desc_init();
  simsense_rig_desc rig = simsense_rig_desc_init();
  simsense_parameters parameters = simsense_parameters_init();
  simsense_compute_desc compute = simsense_compute_desc_init();
  simsense_output_desc output;
  uint32_t random = 1, i;
  for (i = 0; i < width * height; ++i) image[i] = (uint8_t)((random = random * 1664525u + 1013904223u) >> 24);
  choice.select = KS_SELECT_HOST;
  check(api->device_create(&choice, &device), api->last_error());
  rig.left.width = width;
  rig.left.height = height;
  rig.left.k[0] = rig.left.k[4] = 120;
  rig.left.k[2] = 63.5;
  rig.left.k[5] = 47.5;
  rig.left.k[8] = 1;
  rig.left.lens.distortion[0] = 0.05;
  rig.right = rig.left;
  rig.left_to_right[3] = -0.05;
  rig.left_to_right[0] = rig.left_to_right[5] = cos(0.01);
  rig.left_to_right[1] = -sin(0.01);
  rig.left_to_right[4] = sin(0.01);
  parameters.max_disparity = 32;
  check(api->engine_create(device, &rig, &parameters, &engine), api->last_error());
  memset(&output, 0, sizeof output);
  output.header = ks_header_make(SIMSENSE_TYPE_OUTPUT_DESC, (uint32_t)sizeof output);
  output.output = SIMSENSE_OUTPUT_DISPARITY;
  output.image.host = disparity;
  output.image.image = ks_image_desc_packed(KS_FORMAT_F32, 2, shape);
  compute.left.host = compute.right.host = image;
  compute.left.image = compute.right.image = ks_image_desc_packed(KS_FORMAT_U8, 2, shape);
  compute.outputs = &output;
  compute.output_count = 1;
  check(api->engine_compute(engine, &compute), api->last_error());
  api->engine_release(engine);
  api->device_release(device);
}

int main(int count, char** arguments) {
  kuafu_get_api_fn kuafu;
  simsense_get_api_fn simsense;
  void* entry;
  if (count != 4) return 2;
  entry = table_of(arguments[1], "kuafu_get_api");
  memcpy(&kuafu, &entry, sizeof entry); /* C has no cast from an object's address to a function's */
  entry = table_of(arguments[2], "simsense_get_api");
  memcpy(&simsense, &entry, sizeof entry);
  if (!KUAFU_API_HAS(kuafu(), renderer_render) || !SIMSENSE_API_HAS(simsense(), engine_compute)) return 1;
  match(simsense());
  render(kuafu(), arguments[3]);
  printf("undisturbed\n");
  return 0;
}
