// Our own two-level BVH2, built on the host and traced in Vulkan compute: the portable tracer of GPUs, and of CPU devices when asked for.
#include <array>

#include "accel/instance_bvh.h"
#include "accel/mesh_bvh.h"
#include "accel/tracer.h"
#include "device/error.h"
#include "shared/ray_queue.h"
#include "spirv/trace_closest.h"
#include "spirv/trace_occluded.h"

namespace kuafu {
namespace {

struct TracePush {
  uint64_t words, environments, count, roots, nodes, instances;
  uint32_t capacity, environment_count, has_environments, unused = 0;
};

/// Device memory that holds one array; grown when needed, else written in place.
class ArrayBuffer {
 public:
  template <class T>
  void upload(const std::shared_ptr<ks::Device>& device, const std::vector<T>& values) {
    const uint64_t bytes = std::max<uint64_t>(values.size() * sizeof(T), 16);
    if (!buffer_ || buffer_->size_bytes() < bytes) buffer_ = ks::Buffer::create(device, bytes, 0);
    if (!values.empty()) buffer_->write(0, values.data(), values.size() * sizeof(T));
  }
  [[nodiscard]] uint64_t address() const { return buffer_ ? buffer_->address() : 0; }

 private:
  std::shared_ptr<ks::Buffer> buffer_;
};

class ComputeTracer final : public Tracer {
 public:
  ComputeTracer(std::shared_ptr<ks::Device> device, uint32_t layout)
      : device_(std::move(device)),
        layout_(layout),
        group_size_(device_->is_cpu() ? 8 : 32),
        specialisation_{group_size_, layout_},
        closest_(device_, trace_closest_spirv, sizeof(TracePush), specialisation_),
        occluded_(device_, trace_occluded_spirv, sizeof(TracePush), specialisation_) {}

  [[nodiscard]] const char* name() const override { return "compute"; }
  [[nodiscard]] uint32_t queue_layout() const override { return layout_; }
  [[nodiscard]] uint32_t trace_group_size() const override { return group_size_; }

  void update(const Scene& scene, uint32_t environment_count) override {
    if (environment_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "a tracer needs at least one environment");
    if (&scene != scene_) forget_meshes(scene);
    if (meshes_.size() < scene.meshes().size()) add_meshes(scene);
    if (scene.revisions().instances != instances_revision_ || environment_count != environment_count_) {
      std::vector<Placement> placements = live_placements(scene);
      if (placements != placements_ || environment_count != environment_count_) place(std::move(placements), environment_count);
      instances_revision_ = scene.revisions().instances;
    }
  }

  void closest(ks::Commands& commands, const RayQueue& rays) override {
    commands.begin_stage("trace closest");
    commands.dispatch_indirect(closest_, push(rays), *rays.counters, rays.arguments_offset);
  }

  void occluded(ks::Commands& commands, const RayQueue& rays) override {
    commands.begin_stage("trace occluded");
    commands.dispatch_indirect(occluded_, push(rays), *rays.counters, rays.arguments_offset);
  }

 private:
  struct PlacedMesh {
    uint64_t nodes, triangles;  // device addresses
  };

  void forget_meshes(const Scene& scene) {
    scene_ = &scene;
    blocks_.clear(), meshes_.clear(), bounds_.clear(), placements_.clear();
    instances_revision_ = 0, environment_count_ = 0;
  }

  /// All meshes that are new go into one allocation: nodes of 64 and triangles of 48 bytes, mesh after mesh.
  void add_meshes(const Scene& scene) {
    const size_t first = meshes_.size();
    std::vector<MeshBvh> built(scene.meshes().size() - first);
    device_->workers().parallel_for(built.size(), [&](size_t i) { built[i] = build_mesh_bvh(scene.meshes()[first + i]); });
    std::vector<std::byte> bytes;
    const auto append = [&bytes](const auto& values) {
      bytes.resize((bytes.size() + sizeof(BvhNode) - 1) / sizeof(BvhNode) * sizeof(BvhNode));  // a node in one cache line
      const size_t offset = bytes.size();
      const auto span = std::as_bytes(std::span(values));
      bytes.insert(bytes.end(), span.begin(), span.end());
      return offset;
    };
    for (const MeshBvh& mesh : built) {
      meshes_.push_back({append(mesh.nodes), append(mesh.triangles)});
      bounds_.push_back(mesh.bounds);
    }
    blocks_.emplace_back().upload(device_, bytes);
    for (size_t i = first; i < meshes_.size(); ++i) {
      meshes_[i].nodes += blocks_.back().address();
      meshes_[i].triangles += blocks_.back().address();
    }
  }

  void place(std::vector<Placement> placements, uint32_t environment_count) {
    const InstanceBvhs top = build_instance_bvhs(placements, bounds_, environment_count, device_->workers());
    std::vector<BvhInstance> records;
    records.reserve(placements.size());
    for (const Placement& p : placements) {
      const glm::mat4 rows(glm::transpose(p.world_to_local));
      records.push_back({rows[0], rows[1], rows[2], meshes_[p.mesh].nodes, meshes_[p.mesh].triangles});
    }
    nodes_.upload(device_, top.nodes);
    instances_.upload(device_, records);
    roots_.upload(device_, top.roots);
    placements_ = std::move(placements);
    environment_count_ = environment_count;
  }

  [[nodiscard]] TracePush push(const RayQueue& rays) const {
    if (environment_count_ == 0) ks::fail(KS_ERROR_INVALID_STATE, "the tracer has not seen a scene yet: call update first");
    return {rays.words->address(),
            rays.environments ? rays.environments->address() : 0,
            rays.counters->address() + rays.count_offset,
            roots_.address(),
            nodes_.address(),
            instances_.address(),
            rays.capacity,
            environment_count_,
            rays.environments ? 1u : 0u};
  }

  std::shared_ptr<ks::Device> device_;
  uint32_t layout_, group_size_;
  std::array<uint32_t, 2> specialisation_;
  ks::ComputePipeline closest_, occluded_;

  const Scene* scene_ = nullptr;
  std::vector<ArrayBuffer> blocks_;  // bottom levels
  std::vector<PlacedMesh> meshes_;
  std::vector<Box> bounds_;
  std::vector<Placement> placements_;
  uint64_t instances_revision_ = 0;
  uint32_t environment_count_ = 0;
  ArrayBuffer nodes_, instances_, roots_;
};

}  // namespace

std::unique_ptr<Tracer> make_compute_tracer(std::shared_ptr<ks::Device> device, uint32_t layout) {
  return std::make_unique<ComputeTracer>(std::move(device), layout);
}

}  // namespace kuafu
