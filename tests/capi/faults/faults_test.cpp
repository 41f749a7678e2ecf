// SPDX-License-Identifier: Apache-2.0
// A device that runs out of memory, cannot compile a shader or is lost, at every place where it can be: the status says so, nothing is
// corrupted, and what follows has the bits of a run without a fault. The faults are made by a Vulkan layer (fault_layer.h).
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>
#include <map>
#include <vector>

#include "capi/faults/fault_layer.h"
#include "capi/small_render.h"

namespace ks::test {
namespace {

/// The layer, which every instance of this program gets.
class Layer : public testing::Environment {
 public:
  Layer() {
    setenv("VK_LAYER_PATH", FAULT_LAYER_FOLDER, 1);
    setenv("VK_INSTANCE_LAYERS", FAULT_LAYER_NAME, 1);
    void* library = dlopen(FAULT_LAYER_LIBRARY, RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) std::fprintf(stderr, "%s\n", dlerror()), std::abort();
    arm = reinterpret_cast<fault_arm_fn>(dlsym(library, "fault_arm"));
    fired = reinterpret_cast<fault_fired_fn>(dlsym(library, "fault_fired"));
  }
  fault_arm_fn arm;
  fault_fired_fn fired;
};
Layer* const layer = static_cast<Layer*>(testing::AddGlobalTestEnvironment(new Layer));

struct Outcome {
  ks_status status = KS_OK;
  std::vector<float> image;
  bool operator==(const Outcome&) const = default;
};

/// Every step's status is KS_OK, or that of the fault, which ends the run.
#define KS_STEP(call)                                            \
  if (const ks_status status = (call); status != KS_OK) return { \
      status, {}                                                 \
    }

struct KuafuObjects {
  kuafu_device device = nullptr;
  kuafu_scene scene = nullptr;
  kuafu_renderer renderer = nullptr;
  kuafu_buffer buffer = nullptr;
  ~KuafuObjects() {
    kuafu_buffer_release(buffer);
    kuafu_renderer_release(renderer);
    kuafu_scene_release(scene);
    kuafu_device_release(device);
  }
};

constexpr uint32_t side = 32;
constexpr uint64_t shape[4] = {1, side, side, 1};

Outcome render(KuafuObjects& o) {
  kuafu_view_desc view = kuafu_view_desc_init();
  view.band = KUAFU_BAND_INFRARED;
  view.camera.width = view.camera.height = side;
  view.camera.k[0] = view.camera.k[4] = 30, view.camera.k[2] = view.camera.k[5] = 15.5;
  const kuafu_output_desc output = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, o.buffer, ks_image_desc_packed(KS_FORMAT_F32, 4, shape));
  kuafu_render_desc desc = kuafu_render_desc_init();
  desc.views = &view, desc.view_count = 1, desc.outputs = &output, desc.output_count = 1, desc.samples_per_pixel = 2;
  KS_STEP(kuafu_renderer_render(o.renderer, o.scene, &desc));
  Outcome outcome{KS_OK, std::vector<float>(side * side)};
  KS_STEP(kuafu_buffer_read(o.buffer, 0, outcome.image.data(), outcome.image.size() * sizeof(float)));
  return outcome;
}

Outcome render_all(KuafuObjects& o, uint32_t tracer) {
  const float positions[] = {-9, -9, 2, 9, -9, 2, -9, 9, 2};
  const uint32_t indices[] = {0, 1, 2};
  kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
  mesh.positions = positions, mesh.vertex_count = 3, mesh.indices = indices, mesh.triangle_count = 1;
  kuafu_instance_desc instance = kuafu_instance_desc_init(1);
  kuafu_environment_desc environment = kuafu_environment_desc_init();
  for (float& r : environment.radiance) r = 1.0f;
  kuafu_renderer_desc desc = kuafu_renderer_desc_init();
  desc.tracer = tracer;
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(side * side * sizeof(float), KS_BUFFER_HOST_VISIBLE);
  ks_device_desc cpu = ks_device_desc_init();
  cpu.select = KS_SELECT_CPU, cpu.worker_count = 2;
  uint32_t id = 0;
  KS_STEP(kuafu_device_create(&cpu, &o.device));
  KS_STEP(kuafu_scene_create(o.device, &o.scene));
  KS_STEP(kuafu_scene_add_mesh(o.scene, &mesh, &instance.mesh));
  KS_STEP(kuafu_scene_add_instance(o.scene, &instance, &id));
  KS_STEP(kuafu_scene_set_environment(o.scene, &environment));
  KS_STEP(kuafu_renderer_create(o.device, &desc, &o.renderer));
  KS_STEP(kuafu_buffer_create(o.device, &create, &o.buffer));
  return render(o);
}

Outcome render_by_embree(KuafuObjects& o) { return render_all(o, KUAFU_TRACER_EMBREE); }
Outcome render_by_compute(KuafuObjects& o) { return render_all(o, KUAFU_TRACER_COMPUTE); }

struct SimsenseObjects {
  simsense_device device = nullptr;
  simsense_engine engine = nullptr;
  ~SimsenseObjects() {
    simsense_engine_release(engine);
    simsense_device_release(device);
  }
};

Outcome match(SimsenseObjects& o) {
  const uint64_t pair_shape[2] = {side, side};
  std::vector<uint8_t> light(side * side);
  for (size_t i = 0; i < light.size(); ++i) light[i] = static_cast<uint8_t>(i * i >> 3);
  Outcome outcome{KS_OK, std::vector<float>(side * side)};
  simsense_image image{.buffer = nullptr, .host = outcome.image.data(), .image = ks_image_desc_packed(KS_FORMAT_F32, 2, pair_shape)};
  const simsense_output_desc output = simsense_output_desc_init(SIMSENSE_OUTPUT_DISPARITY, image);
  image.host = light.data(), image.image = ks_image_desc_packed(KS_FORMAT_U8, 2, pair_shape);
  simsense_compute_desc desc = simsense_compute_desc_init();
  desc.left = desc.right = image;
  desc.outputs = &output, desc.output_count = 1;
  KS_STEP(simsense_engine_compute(o.engine, &desc));
  return outcome;
}

Outcome match_all(SimsenseObjects& o) {
  ks_device_desc cpu = ks_device_desc_init();
  cpu.select = KS_SELECT_CPU, cpu.worker_count = 2;
  simsense_rig_desc rig = simsense_rig_desc_init();
  for (simsense_camera* camera : {&rig.left, &rig.right}) {
    camera->width = camera->height = side;
    camera->k[0] = camera->k[4] = 30, camera->k[2] = camera->k[5] = 15.5, camera->k[8] = 1;
  }
  rig.left_to_right[3] = -0.05, rig.rectified = 1, rig.back_end = SIMSENSE_BACK_END_VULKAN;
  simsense_parameters parameters = simsense_parameters_init();
  parameters.max_disparity = 16;
  KS_STEP(simsense_device_create(&cpu, &o.device));
  KS_STEP(simsense_engine_create(o.device, &rig, &parameters, &o.engine));
  return match(o);
}

template <class Objects>
using Job = Outcome (*)(Objects&);

/// Runs the job with the fault at the first such call, at the second, and so on until it has no such call left: each outcome is the error,
/// or that of a job without a fault. What no fault meets after all of them has the outcome that it had before. `after` is given the objects
/// of each job that failed.
template <class Objects>
void expect_errors(fault what, ks_status expected, Job<Objects> job, const std::function<void(Objects&)>& after = {}) {
  static std::map<Job<Objects>, Outcome> undisturbed;
  Outcome& sound = undisturbed[job];
  if (sound.image.empty()) {
    Objects objects;
    sound = job(objects);
  }
  ASSERT_EQ(sound.status, KS_OK) << kuafu_last_error() << simsense_last_error();
  for (int place = 0; !testing::Test::HasFailure(); ++place) {
    SCOPED_TRACE(place);
    const int before = layer->fired(what);
    Objects objects;
    layer->arm(what, place);
    const Outcome outcome = job(objects);
    layer->arm(what, -1);
    if (layer->fired(what) == before) {
      std::printf("%d places\n", place);
      EXPECT_GE(place, 1) << "the layer hears nothing";
      EXPECT_EQ(outcome, sound);
      break;
    }
    if (outcome.status == KS_OK) {  // where there is other memory, it takes that
      EXPECT_EQ(outcome, sound);
      EXPECT_NE(expected, KS_ERROR_DEVICE_LOST);
      continue;
    }
    EXPECT_EQ(outcome.status, expected) << kuafu_last_error() << simsense_last_error();
    if (after) after(objects);
  }
}

TEST(Faults, KuafuOutOfDeviceMemory) { expect_errors<KuafuObjects>(FAULT_ALLOCATE, KS_ERROR_OUT_OF_DEVICE_MEMORY, render_by_embree); }
TEST(Faults, KuafuShadersThatCannotBeCompiled) {
  expect_errors<KuafuObjects>(FAULT_PIPELINE, KS_ERROR_OUT_OF_HOST_MEMORY, render_by_compute);
}
/// A lost device says so from then on, in every call that would use it.
TEST(Faults, KuafuDeviceLost) {
  expect_errors<KuafuObjects>(FAULT_SUBMIT, KS_ERROR_DEVICE_LOST, render_by_compute, [](KuafuObjects& o) {
    if (o.buffer == nullptr) return;
    EXPECT_EQ(render(o).status, KS_ERROR_DEVICE_LOST);
  });
}
TEST(Faults, SimsenseOutOfDeviceMemory) { expect_errors<SimsenseObjects>(FAULT_ALLOCATE, KS_ERROR_OUT_OF_DEVICE_MEMORY, match_all); }
TEST(Faults, SimsenseShadersThatCannotBeCompiled) {
  expect_errors<SimsenseObjects>(FAULT_PIPELINE, KS_ERROR_OUT_OF_HOST_MEMORY, match_all);
}
TEST(Faults, SimsenseDeviceLost) { expect_errors<SimsenseObjects>(FAULT_SUBMIT, KS_ERROR_DEVICE_LOST, match_all); }

/// After a fault the same objects serve on.
TEST(Faults, ARendererThatRanOutOfMemoryRendersAgain) {
  KuafuObjects objects;
  const Outcome sound = render_by_embree(objects);
  ASSERT_EQ(sound.status, KS_OK) << kuafu_last_error();
  const int before = layer->fired(FAULT_ALLOCATE);
  kuafu_buffer large = nullptr;
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(1 << 20, 0);
  layer->arm(FAULT_ALLOCATE, 0);
  EXPECT_EQ(kuafu_buffer_create(objects.device, &create, &large), KS_ERROR_OUT_OF_DEVICE_MEMORY);
  layer->arm(FAULT_ALLOCATE, -1);
  EXPECT_EQ(layer->fired(FAULT_ALLOCATE), before + 1);
  EXPECT_EQ(render(objects), sound);
}

}  // namespace
}  // namespace ks::test
