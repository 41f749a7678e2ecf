// The renderer functions of kuafu's C API.
#include <algorithm>
#include <cstring>

#include "api/handles.h"
#include "api/render_launch.h"
#include "api/render_outputs.h"
#include "api/struct_table.h"
#include "device/struct_read.h"
#include "render/renderer.h"

struct kuafu_renderer_t : ks::Handle<kuafu::Renderer, 0x6b726e64> {
  using Handle::Handle;
};

namespace {

kuafu::TracerKind tracer_kind(uint32_t tracer) {
  switch (tracer) {
    case KUAFU_TRACER_AUTO:
      return kuafu::TracerKind::automatic;
    case KUAFU_TRACER_EMBREE:
      return kuafu::TracerKind::embree;
    case KUAFU_TRACER_COMPUTE:
      return kuafu::TracerKind::compute;
    case KUAFU_TRACER_RT_PIPELINE:
      return kuafu::TracerKind::rt_pipeline;
    default:
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "tracer %u is no KUAFU_TRACER_*", tracer);
  }
}

}  // namespace

extern "C" {

ks_status kuafu_renderer_create(kuafu_device device, const kuafu_renderer_desc* desc, kuafu_renderer* out) {
  return ks::guard([&] {
    ks::clear_out(out);
    const kuafu_renderer_desc d =
        desc == nullptr ? kuafu_renderer_desc_init() : ks::read_struct(desc, KUAFU_TYPE_RENDERER_DESC, "renderer desc");
    const std::string library = d.oidn_library == nullptr ? "" : d.oidn_library;
    *out = new kuafu_renderer_t(std::make_shared<kuafu::Renderer>(ks::object_of(device, "device"), tracer_kind(d.tracer), library));
  });
}

void kuafu_renderer_retain(kuafu_renderer renderer) { ks::retain(renderer, "renderer"); }

void kuafu_renderer_release(kuafu_renderer renderer) { ks::release(renderer, "renderer"); }

ks_status kuafu_renderer_render(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc) {
  return ks::guard([&] {
    kuafu::Renderer& images = *ks::object_of(renderer, "renderer");
    const std::shared_ptr<kuafu::DeviceScene>& owner = ks::object_of(scene, "scene");
    const kuafu::Launch launch = kuafu::read_launch(desc, *images.device());
    kuafu::check_ids_fit(launch, owner->scene);
    images.render(std::shared_ptr<const kuafu::Scene>(owner, &owner->scene), launch);
  });
}

ks_status kuafu_renderer_get_summary(kuafu_renderer renderer, kuafu_render_summary* out) {
  return ks::guard([&] {
    const kuafu::RenderSummary& last = ks::object_of(renderer, "renderer")->summary();
    kuafu_render_summary summary = kuafu_render_summary_init();
    summary.samples_per_pixel = last.samples;
    summary.call_samples_per_pixel = last.call_samples;
    summary.relative_error = last.relative_error;
    summary.seconds = last.seconds;
    ks::write_struct(out, summary, KUAFU_TYPE_RENDER_SUMMARY, "out");
  });
}

ks_status kuafu_renderer_get_stage_times(kuafu_renderer renderer, ks_stage_time* times, uint32_t* count) {
  return ks::guard([&] {
    const auto& stages = ks::object_of(renderer, "renderer")->stage_times();
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
