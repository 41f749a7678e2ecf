// SPDX-License-Identifier: Apache-2.0
// Runs rays through a tracer: fills a queue in the tracer's own layout, traces, and reads the answers back.
#pragma once

#include <bit>
#include <limits>
#include <memory>
#include <vector>

#include "accel/tracer.h"
#include "device/thread_pool.h"

namespace kuafu::test {

struct TestRay {
  glm::vec3 origin{0.0f};
  float t_near = 0.0f;
  glm::vec3 direction{0.0f, 0.0f, 1.0f};
  float t_far = std::numeric_limits<float>::infinity();
  uint32_t environment = 0;
};

struct TestHit {
  bool hit = false;
  float t = 0.0f, u = 0.0f, v = 0.0f;
  uint32_t primitive = miss, instance = miss;
  bool operator==(const TestHit&) const = default;
};

/// The device the tests share: the best there is, which on a machine without GPU is lavapipe.
inline std::shared_ptr<ks::Device> test_device() {
  static const std::shared_ptr<ks::Device> device = ks::Device::create(ks_device_desc_init());
  return device;
}

class RayBench {
 public:
  explicit RayBench(Tracer& tracer) : tracer_(tracer), commands_(test_device()) {}

  std::vector<TestHit> closest(const std::vector<TestRay>& rays, bool coherent = false) {
    coherent_ = coherent;
    trace(rays, closest_words, &Tracer::closest);
    std::vector<TestHit> hits(rays.size());
    for (uint32_t i = 0; i < hits.size(); ++i) {
      if (word(i, hit_geometry) == miss) continue;
      hits[i] = {true, value(i, ray_t_far), value(i, hit_u), value(i, hit_v), word(i, hit_primitive), word(i, hit_instance)};
    }
    return hits;
  }

  std::vector<bool> occluded(const std::vector<TestRay>& rays) {
    trace(rays, occlusion_words, &Tracer::occluded);
    std::vector<bool> hits(rays.size());
    for (uint32_t i = 0; i < hits.size(); ++i) hits[i] = value(i, ray_t_far) < 0.0f;
    return hits;
  }

  /// Lanes past the count, which no tracer may touch, still hold what fill() put there.
  [[nodiscard]] bool tail_untouched(uint32_t count) const {
    for (uint32_t i = count; i < capacity_; ++i)
      for (uint32_t field = 0; field < words_; ++field)
        if (has_field(field) && word(i, field) != tail_mark) return false;
    return true;
  }

 private:
  static constexpr uint32_t tail_mark = 0x3f800000u;  // 1.0f in every field: as a ray, it would hit things

  void trace(const std::vector<TestRay>& rays, uint32_t words, void (Tracer::*call)(ks::Commands&, const RayQueue&)) {
    fill(rays, words);
    (tracer_.*call)(commands_, queue());
    commands_.flush();
    words_buffer_->read(0, queue_words_.data(), queue_words_.size() * 4);
  }

  void fill(const std::vector<TestRay>& rays, uint32_t words) {
    words_ = words;
    capacity_ = uint32_t(rays.size() + 8) / 8 * 8;
    const uint32_t layout = tracer_.queue_layout(), words_per_ray = queue_words_per_ray(words, layout);
    words_buffer_ = create(uint64_t(capacity_) * words_per_ray * 4);
    environments_buffer_ = create(uint64_t(capacity_) * 4);
    counters_ = create(64);
    queue_words_.resize(size_t(capacity_) * words_per_ray);
    environments_.assign(capacity_, 0);
    for (uint32_t i = 0; i < capacity_; ++i)
      for (uint32_t field = 0; field < words; ++field)
        if (has_field(field)) set(i, field, i < rays.size() ? 0u : tail_mark);
    for (uint32_t i = 0; i < rays.size(); ++i) fill_ray(i, rays[i]);
    // Two rows of groups where there are enough: shaders must not count on a one-dimensional grid.
    const auto count = uint32_t(rays.size());
    const uint32_t groups =
        std::max((count + tracer_.trace_group_size() - 1) / tracer_.trace_group_size(), std::min(count, tracer_.spread_groups()));
    const uint32_t rows = groups > 1 ? 2 : 1;
    const uint32_t counters[] = {0, uint32_t(rays.size()), (groups + rows - 1) / rows, groups ? rows : 0, 1};
    counters_->write(0, counters, sizeof counters);
    words_buffer_->write(0, queue_words_.data(), queue_words_.size() * 4);
    environments_buffer_->write(0, environments_.data(), environments_.size() * 4);
  }

  void fill_ray(uint32_t i, const TestRay& ray) {
    for (uint32_t axis = 0; axis < 3; ++axis) {
      set(i, ray_origin + axis, std::bit_cast<uint32_t>(ray.origin[int(axis)]));
      set(i, ray_direction + axis, std::bit_cast<uint32_t>(ray.direction[int(axis)]));
    }
    set(i, ray_t_near, std::bit_cast<uint32_t>(ray.t_near));
    set(i, ray_t_far, std::bit_cast<uint32_t>(ray.t_far));
    if (has_field(ray_mask)) set(i, ray_mask, 0xffffffffu);
    set(i, ray_id, i);
    if (words_ == closest_words) set(i, hit_geometry, miss);
    environments_[i] = ray.environment;
    if (ray.environment != 0) has_environments_ = true;
  }

  [[nodiscard]] RayQueue queue() const {
    return {.words = words_buffer_.get(),
            .environments = has_environments_ ? environments_buffer_.get() : nullptr,
            .counters = counters_.get(),
            .count_offset = 4,
            .arguments_offset = 8,
            .capacity = capacity_,
            .coherent = coherent_};
  }
  /// Planes leave out what Embree alone asks for.
  [[nodiscard]] bool has_field(uint32_t field) const {
    return tracer_.queue_layout() == queue_layout_packets || (field <= ray_id && field != ray_mask) || field >= hit_u;
  }
  [[nodiscard]] size_t at(uint32_t i, uint32_t field) const { return ray_word(i, field, words_, tracer_.queue_layout(), capacity_); }
  void set(uint32_t i, uint32_t field, uint32_t value) { queue_words_[at(i, field)] = value; }
  [[nodiscard]] uint32_t word(uint32_t i, uint32_t field) const { return queue_words_[at(i, field)]; }
  [[nodiscard]] float value(uint32_t i, uint32_t field) const { return std::bit_cast<float>(word(i, field)); }

  /// Packets are what a host tracer reads in place; planes may lie in the GPU's own memory.
  [[nodiscard]] std::shared_ptr<ks::Buffer> create(uint64_t bytes) const {
    return ks::Buffer::create(test_device(), bytes, tracer_.queue_layout() == queue_layout_packets ? KS_BUFFER_HOST_VISIBLE : 0);
  }

  Tracer& tracer_;
  ks::Commands commands_;
  uint32_t words_ = 0, capacity_ = 0;
  bool has_environments_ = false, coherent_ = false;
  std::shared_ptr<ks::Buffer> words_buffer_, environments_buffer_, counters_;
  std::vector<uint32_t> queue_words_, environments_;
};

}  // namespace kuafu::test
