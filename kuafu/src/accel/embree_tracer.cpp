// SPDX-License-Identifier: Apache-2.0
// Rays of CPU devices: Embree answers the queues on the host, in place on their mapped memory.
#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstddef>

#include "accel/embree_cutout.h"
#include "accel/embree_world.h"
#include "accel/tracer.h"
#include "device/error.h"
#include "device/thread_pool.h"

namespace kuafu {
namespace {

constexpr uint32_t packet_rays = 8;
constexpr uint32_t chunk_packets = 64;  // per task: long enough to hide the hand-over, short enough to balance

static_assert(sizeof(RTCRayHit8) == closest_words * packet_rays * 4 &&
              offsetof(RTCRayHit8, hit.primID) == hit_primitive * packet_rays * 4 &&
              offsetof(RTCRayHit8, hit.instID) == hit_instance * packet_rays * 4);
static_assert(sizeof(RTCRay8) == occlusion_words * packet_rays * 4 && offsetof(RTCRay8, tfar) == ray_t_far * packet_rays * 4);

/// A queue as the host sees it.
struct MappedQueue {
  std::byte* words;
  const uint32_t* environments;  // nullptr = all 0
  uint32_t count;
  RTCIntersectContextFlags flags;
  const SceneAddresses* scene;  // RayQueue::scene
};

template <class T>
T* mapped(const ks::Buffer& buffer, const char* name) {
  if (!buffer.mapped())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "the Embree tracer needs host visible memory, and the queue's %s are not", name);
  return static_cast<T*>(buffer.mapped());
}

MappedQueue map_queue(const RayQueue& rays, size_t alignment) {
  MappedQueue queue{mapped<std::byte>(*rays.words, "words"), nullptr, 0, RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT,
                    reinterpret_cast<const SceneAddresses*>(rays.scene)};  // NOLINT(performance-no-int-to-ptr): an address on the host
  // Measured: camera rays gain 1.45x from it, bounced rays lose 2x, shadow rays lose a little.
  if (rays.coherent) queue.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  if (rays.environments) queue.environments = mapped<const uint32_t>(*rays.environments, "environments");
  queue.count = *reinterpret_cast<const uint32_t*>(mapped<const std::byte>(*rays.counters, "counters") + rays.count_offset);
  if (queue.count > rays.capacity) ks::fail(KS_ERROR_INTERNAL, "a ray queue of %u rays claims to hold %u", rays.capacity, queue.count);
  if (reinterpret_cast<uintptr_t>(queue.words) % alignment != 0)
    ks::fail(KS_ERROR_INTERNAL, "a ray queue at %p is not aligned to %zu bytes", static_cast<void*>(queue.words), alignment);
  return queue;
}

RTCRay8& rays_of(RTCRayHit8& packet) { return packet.ray; }
RTCRay8& rays_of(RTCRay8& packet) { return packet; }

/// Gives a packet's rays Embree's times, 0..1, while it lives; a queue's are in seconds.
class EmbreeTimes {
 public:
  EmbreeTimes(RTCRay8& rays, const TimeSpan& span) : rays_(span.instant() ? nullptr : &rays) {
    if (!rays_) return;
    std::copy_n(rays.time, packet_rays, seconds_);
    const auto from = float(span.from_s), scale = float(1.0 / (span.until_s - span.from_s));
    for (float& t : rays.time) t = std::clamp((t - from) * scale, 0.0f, 1.0f);
  }
  ~EmbreeTimes() {
    if (rays_) std::copy_n(seconds_, packet_rays, rays_->time);
  }
  EmbreeTimes(const EmbreeTimes&) = delete;
  EmbreeTimes& operator=(const EmbreeTimes&) = delete;

 private:
  RTCRay8* rays_;
  float seconds_[packet_rays];
};

/// Embree stops the program at a ray that is not finite or starts beyond 1.8e18 m (its FLT_LARGE). Such a ray hits nothing; NaN fails too.
bool can_trace(const RTCRay8& ray, uint32_t lane) {
  constexpr float most = 1.8e18f;
  const auto fits = [](float x, float y, float z) { return std::abs(x) <= most && std::abs(y) <= most && std::abs(z) <= most; };
  return fits(ray.org_x[lane], ray.org_y[lane], ray.org_z[lane]) && fits(ray.dir_x[lane], ray.dir_y[lane], ray.dir_z[lane]) &&
         ray.tnear[lane] <= ray.tfar[lane];
}

void trace(const EmbreeWorld::Environment& environment, const int* valid, RTCIntersectContext& context, RTCRayHit8& packet) {
  rtcIntersect8(valid, environment.scene.get(), &context, &packet);
  if (environment.apart) rtcIntersect8(valid, environment.apart.get(), &context, &packet);
  for (uint32_t lane = 0; lane < packet_rays; ++lane)
    if (valid[lane] && packet.hit.geomID[lane] != miss) packet.hit.instID[0][lane] = environment.instances[packet.hit.instID[0][lane]];
}

void trace(const EmbreeWorld::Environment& environment, const int* valid, RTCIntersectContext& context, RTCRay8& packet) {
  rtcOccluded8(valid, environment.scene.get(), &context, &packet);
  if (!environment.apart) return;
  alignas(32) int open[packet_rays];
  for (uint32_t lane = 0; lane < packet_rays; ++lane) open[lane] = packet.tfar[lane] >= 0.0f ? valid[lane] : 0;
  rtcOccluded8(open, environment.apart.get(), &context, &packet);
}

class EmbreeTracer final : public Tracer {
 public:
  explicit EmbreeTracer(std::shared_ptr<ks::Device> device) : device_(std::move(device)) {}

  [[nodiscard]] const char* name() const override { return "embree"; }
  [[nodiscard]] uint32_t queue_layout() const override { return queue_layout_packets; }
  [[nodiscard]] uint32_t trace_group_size() const override { return packet_rays; }

  void update(const Scene& scene, uint32_t environment_count, const TimeSpan& open) override {
    world_.update(scene, environment_count, open);
  }
  void closest(ks::Commands& commands, const RayQueue& rays) override { run<RTCRayHit8>(commands, rays, "trace closest"); }
  void occluded(ks::Commands& commands, const RayQueue& rays) override { run<RTCRay8>(commands, rays, "trace occluded"); }

 private:
  template <class Packet>
  void run(ks::Commands& commands, const RayQueue& rays, const char* stage) {
    if (world_.environments().empty()) ks::fail(KS_ERROR_INVALID_STATE, "the tracer has not seen a scene yet: call update first");
    commands.flush();
    const auto start = std::chrono::steady_clock::now();
    const MappedQueue queue = map_queue(rays, alignof(Packet));
    const uint32_t packets = (queue.count + packet_rays - 1) / packet_rays;
    device_->workers().parallel_for((packets + chunk_packets - 1) / chunk_packets, [&](size_t chunk) {
      const FlushDenormals flush;
      const auto first = uint32_t(chunk) * chunk_packets;
      for (uint32_t i = first; i < std::min(packets, first + chunk_packets); ++i) trace_packet<Packet>(queue, i);
    });
    commands.add_host_time(stage, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }

  /// One call per environment that the packet's rays stand in; almost always one.
  template <class Packet>
  void trace_packet(const MappedQueue& queue, uint32_t index) const {
    auto& packet = reinterpret_cast<Packet*>(queue.words)[index];
    EmbreeContext context;
    rtcInitIntersectContext(&context.context);
    context.context.flags = queue.flags;
    context.scene = queue.scene;
    context.kind = std::is_same_v<Packet, RTCRayHit8> ? cutout_closest : cutout_occluded;
    const EmbreeTimes times(rays_of(packet), world_.times());
    const uint32_t first = index * packet_rays;
    uint32_t waiting = queue.count - first >= packet_rays ? 0xffu : (1u << (queue.count - first)) - 1u;
    while (waiting != 0) {
      const uint32_t environment = queue.environments ? queue.environments[first + uint32_t(std::countr_zero(waiting))] : 0;
      alignas(32) int valid[packet_rays];
      for (uint32_t lane = 0; lane < packet_rays; ++lane) {
        const bool here = (waiting >> lane & 1u) && (!queue.environments || queue.environments[first + lane] == environment);
        valid[lane] = here && can_trace(rays_of(packet), lane) ? -1 : 0;
        if (here) waiting &= ~(1u << lane);
      }
      if (environment >= world_.environments().size()) continue;
      context.instances = world_.environments()[environment].instances.data();
      trace(world_.environments()[environment], valid, context.context, packet);
    }
  }

  std::shared_ptr<ks::Device> device_;
  EmbreeWorld world_;
};

}  // namespace

std::unique_ptr<Tracer> make_embree_tracer(std::shared_ptr<ks::Device> device) { return std::make_unique<EmbreeTracer>(std::move(device)); }

}  // namespace kuafu
