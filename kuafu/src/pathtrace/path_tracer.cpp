#include "pathtrace/path_tracer.h"

#include "device/error.h"
#include "pathtrace/render_run.h"

namespace kuafu {
namespace {

bool wants_embree(const ks::Device& device, TracerKind kind) {
  const bool embree = kind == TracerKind::embree || (kind == TracerKind::automatic && device.is_cpu());
  if (embree && !device.is_cpu())
    ks::fail(KS_ERROR_UNSUPPORTED, "KUAFU_TRACER_EMBREE needs a CPU device, %s is none: use KUAFU_TRACER_AUTO", device.info().name);
  return embree;
}

std::unique_ptr<Tracer> make_tracer(const std::shared_ptr<ks::Device>& device, TracerKind kind) {
  if (wants_embree(*device, kind)) return make_embree_tracer(device);
  return kind == TracerKind::rt_pipeline ? make_rt_tracer(device) : make_compute_tracer(device);
}

}  // namespace

// Where the rays are, there the stages are.
PathTracer::PathTracer(std::shared_ptr<ks::Device> device, TracerKind tracer, std::string oidn_library)
    : device_(std::move(device)),
      on_host_(wants_embree(*device_, tracer)),
      tracer_(make_tracer(device_, tracer)),
      stages_(on_host_ ? make_host_stages(device_) : make_device_stages(device_, *tracer_)),
      tables_(memory()),
      aov_tables_(memory()),
      slots_(memory()),
      frame_(memory()),
      accumulation_(memory()),
      denoiser_(memory(), tracer_->queue_layout(), std::move(oidn_library)),
      film_(memory()) {}

PathTracer::~PathTracer() = default;

void PathTracer::render(const std::shared_ptr<const Scene>& scene, const Launch& launch) {
  next_scene_ = scene;
  // A recorder is made once and kept, unless an error leaves it in the middle of its work.
  std::unique_ptr<ks::Commands> commands = commands_ ? std::move(commands_) : std::make_unique<ks::Commands>(device_);
  slots_.collect_times(*commands);  // of a render that failed
  commands->reset_stage_times();
  Run run(*this, launch, *commands);
  try {
    run.prepare(*scene);
    scene_ = scene;
    run.render();
  } catch (...) {
    accumulation_.clear();  // some pixels have more samples than others
    throw;
  }
  stage_times_ = run.stage_times();
  summary_ = run.summary();
  if (!launch.accumulate) accumulation_.clear();
  commands_ = std::move(commands);
}

}  // namespace kuafu
