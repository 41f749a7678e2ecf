// SPDX-License-Identifier: Apache-2.0
// The renderer functions of kuafu's C API.
#include <algorithm>
#include <cstring>

#include "api/fields.h"
#include "api/handles.h"
#include "api/render_launch.h"
#include "api/struct_table.h"
#include "device/struct_read.h"
#include "device/struct_table.h"
#include "render/render_queue.h"

struct kuafu_renderer_t : ks::Handle<kuafu::RenderQueue, 0x6b726e64> {
  using Handle::Handle;
};

namespace {

static_assert(uint32_t(kuafu::TracerKind::automatic) == KUAFU_TRACER_AUTO && uint32_t(kuafu::TracerKind::embree) == KUAFU_TRACER_EMBREE &&
                  uint32_t(kuafu::TracerKind::compute) == KUAFU_TRACER_COMPUTE &&
                  uint32_t(kuafu::TracerKind::rt_pipeline) == KUAFU_TRACER_RT_PIPELINE,
              "the two count alike");

kuafu::Launch read_launch(const kuafu::RenderQueue& images, const kuafu::Scene& scene, const kuafu_render_desc* desc) {
  kuafu::Launch launch = kuafu::read_launch(desc, images.device());
  kuafu::check_ids_fit(launch, scene);
  return launch;
}

}  // namespace

extern "C" {

ks_status kuafu_renderer_create(kuafu_device device, const kuafu_renderer_desc* desc, kuafu_renderer* out) {
  return ks::call([&] {
    ks::clear_out(out);
    const kuafu_renderer_desc d =
        desc == nullptr ? kuafu_renderer_desc_init() : ks::read_struct(desc, KUAFU_TYPE_RENDERER_DESC, "renderer desc");
    kuafu::check_fields(d, "");
    const std::string library = d.oidn_library == nullptr ? "" : d.oidn_library;
    const auto tracer = static_cast<kuafu::TracerKind>(d.tracer);
    *out = new kuafu_renderer_t(std::make_shared<kuafu::RenderQueue>(ks::object_of(device, "device"), tracer, library));
  });
}

void kuafu_renderer_retain(kuafu_renderer renderer) { ks::retain(renderer, "renderer"); }

void kuafu_renderer_release(kuafu_renderer renderer) { ks::release(renderer, "renderer"); }

ks_status kuafu_renderer_render(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc) {
  return ks::call([&] {
    const ks::Exclusive images(renderer, "renderer");
    const ks::Exclusive owner(scene, "scene");
    images->render(owner->scene, read_launch(*images, owner->scene, desc));
  });
}

ks_status kuafu_renderer_light_gbuffers(kuafu_renderer renderer, kuafu_scene scene, const kuafu_gbuffer_desc* desc) {
  return ks::call([&] {
    const ks::Exclusive images(renderer, "renderer");
    const ks::Exclusive owner(scene, "scene");
    images->light(owner->scene, kuafu::read_gbuffers(desc, owner->scene, images->device()));
  });
}

ks_status kuafu_renderer_submit(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc, ks_sync* out) {
  return ks::call([&] {
    (void)ks::check_header(out, KS_TYPE_SYNC, "out");  // before work begins that nobody could wait for
    const ks::Exclusive images(renderer, "renderer");
    const ks::Exclusive scene_in_use(scene, "scene");
    const std::shared_ptr<kuafu::DeviceScene>& owner = scene_in_use.shared();
    kuafu::Launch launch = read_launch(*images, owner->scene, desc);
    ks_sync sync = ks_sync_init();
    sync.kind = KS_SYNC_TIMELINE;
    sync.value = images->submit(std::shared_ptr<const kuafu::Scene>(owner, &owner->scene), std::move(launch), kuafu::hold_unchanged(owner));
    ks::write_struct(out, sync, KS_TYPE_SYNC, "out");
  });
}

ks_status kuafu_renderer_wait(kuafu_renderer renderer, const ks_sync* sync, uint64_t timeout_ns) {
  return ks::call([&] {
    const ks_sync submission = ks::read_struct(sync, KS_TYPE_SYNC, "sync");
    kuafu::RenderQueue& images = *ks::object_of(renderer, "renderer");
    if (submission.kind != KS_SYNC_TIMELINE)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "sync.kind is %u, a submission's is KS_SYNC_TIMELINE", submission.kind);
    if (!images.wait(submission.value, timeout_ns))
      ks::fail(KS_ERROR_TIMEOUT, "the render has not ended after %.3g s; it goes on", double(timeout_ns) * 1e-9);
  });
}

ks_status kuafu_renderer_cancel(kuafu_renderer renderer) {
  return ks::call([&] { ks::object_of(renderer, "renderer")->cancel(); });
}

ks_status kuafu_renderer_export_timeline(kuafu_renderer renderer, ks_sync* out) {
  return ks::call([&] {
    (void)ks::check_header(out, KS_TYPE_SYNC, "out");  // before an fd is made that nobody would close
    ks::write_struct(out, ks::object_of(renderer, "renderer")->export_timeline(), KS_TYPE_SYNC, "out");
  });
}

ks_status kuafu_renderer_get_summary(kuafu_renderer renderer, kuafu_render_summary* out) {
  return ks::call([&] {
    const kuafu::RenderSummary last = ks::Exclusive(renderer, "renderer")->summary();
    kuafu_render_summary summary = kuafu_render_summary_init();
    summary.samples_per_pixel = last.samples;
    summary.call_samples_per_pixel = last.call_samples;
    summary.relative_error = last.relative_error;
    summary.seconds = last.seconds;
    ks::write_struct(out, summary, KUAFU_TYPE_RENDER_SUMMARY, "out");
  });
}

ks_status kuafu_renderer_get_stage_times(kuafu_renderer renderer, ks_stage_time* times, uint32_t* count) {
  return ks::call([&] {
    const ks::Exclusive images(renderer, "renderer");
    const auto& stages = images->stage_times();
    if (count == nullptr) ks::fail(KS_ERROR_INVALID_ARGUMENT, "count is NULL");
    const size_t written = times == nullptr ? 0 : std::min<size_t>(*count, stages.size());
    for (size_t i = 0; i < written; ++i) {
      times[i] = {};
      stages[i].first.copy(times[i].name, sizeof times[i].name - 1);
      times[i].milliseconds = stages[i].second;
    }
    *count = uint32_t(stages.size());
  });
}

}  // extern "C"
