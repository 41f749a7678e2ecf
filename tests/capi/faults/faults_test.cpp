// SPDX-License-Identifier: Apache-2.0
// A device that runs out of memory, cannot compile a shader or is lost, at every place where it can be: the status says so, nothing is
// corrupted, and what follows has the bits of a run without a fault. The faults are made by a Vulkan layer (fault_layer.h).
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <functional>
#include <map>
#include <optional>
#include <thread>
#include <vector>

#include "capi/faults/fault_layer.h"
#include "capi/small_match.h"
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
    devices = reinterpret_cast<fault_devices_fn>(dlsym(library, "fault_devices"));
  }
  fault_arm_fn arm;
  fault_fired_fn fired;
  fault_devices_fn devices;
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

/// What a job makes, kept until the test has looked at it.
using KuafuObjects = std::optional<SmallRender>;
using SimsenseObjects = std::optional<SmallMatch>;

ks_device_desc cpu() {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_CPU, desc.worker_count = 2;
  return desc;
}

Outcome render(SmallRender& o) {
  KS_STEP(o.render());
  return {KS_OK, o.image()};
}

template <uint32_t tracer>
Outcome render_all(KuafuObjects& o) {
  const ks_device_desc desc = cpu();
  kuafu_device device = nullptr;
  KS_STEP(kuafu_device_create(&desc, &device));
  o.emplace(tracer, device, true);
  KS_STEP(o->status);
  return render(*o);
}
constexpr auto render_by_embree = render_all<KUAFU_TRACER_EMBREE>, render_by_compute = render_all<KUAFU_TRACER_COMPUTE>;

Outcome match_all(SimsenseObjects& o) {
  const ks_device_desc desc = cpu();
  simsense_device device = nullptr;
  KS_STEP(simsense_device_create(&desc, &device));
  o.emplace(
      device, 1, [](simsense_rig_desc& rig) { rig.back_end = SIMSENSE_BACK_END_VULKAN; }, true);
  KS_STEP(o->status);
  KS_STEP(simsense_engine_compute(o->engine, &o->desc));
  return {KS_OK, o->disparity};
}

template <class Objects>
using Job = Outcome (*)(Objects&);

/// Waits for released devices: pipelines still being built keep theirs, run on it, and would meet the next job's fault.
void expect_no_devices() {
  for (int i = 0; i < 30000 && layer->devices() > 0; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_EQ(layer->devices(), 0);
}

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
    ASSERT_NO_FATAL_FAILURE(expect_no_devices());
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
    if (!o || o->buffer == nullptr) return;
    EXPECT_EQ(render(*o).status, KS_ERROR_DEVICE_LOST);
  });
}
TEST(Faults, SimsenseOutOfDeviceMemory) { expect_errors<SimsenseObjects>(FAULT_ALLOCATE, KS_ERROR_OUT_OF_DEVICE_MEMORY, match_all); }
TEST(Faults, SimsenseShadersThatCannotBeCompiled) {
  expect_errors<SimsenseObjects>(FAULT_PIPELINE, KS_ERROR_OUT_OF_HOST_MEMORY, match_all);
}
TEST(Faults, SimsenseDeviceLost) { expect_errors<SimsenseObjects>(FAULT_SUBMIT, KS_ERROR_DEVICE_LOST, match_all); }

/// After a fault the same objects serve on.
TEST(Faults, ARendererThatRanOutOfMemoryRendersAgain) {
  ASSERT_NO_FATAL_FAILURE(expect_no_devices());
  KuafuObjects objects;
  const Outcome sound = render_by_embree(objects);
  ASSERT_EQ(sound.status, KS_OK) << kuafu_last_error();
  const int before = layer->fired(FAULT_ALLOCATE);
  kuafu_buffer large = nullptr;
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(1 << 20, 0);
  layer->arm(FAULT_ALLOCATE, 0);
  EXPECT_EQ(kuafu_buffer_create(objects->device, &create, &large), KS_ERROR_OUT_OF_DEVICE_MEMORY);
  layer->arm(FAULT_ALLOCATE, -1);
  EXPECT_EQ(layer->fired(FAULT_ALLOCATE), before + 1);
  EXPECT_EQ(render(*objects), sound);
}

}  // namespace
}  // namespace ks::test
