// SPDX-License-Identifier: Apache-2.0
// The table of landed beams, on the shaders' text compiled as C++: a point finds the beams that cover it, each once, whatever their
// sections are; and the grids of beams cover the glass.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "frame/host_language.h"
#include "tables/beam_sources.h"

#define KUAFU_CHANNELS 3
namespace kuafu {
namespace {

constexpr uint features = 0u;
#include "lib/refraction.glsl"
#include "lib/shading.glsl"
#include "lib/splat_table.glsl"

struct Follow {
  const BeamPush& push;
#include "stage/follow.glsl"
};
struct TableSteps {
  const SplatTablePush& push;
#include "stage/splat_table.glsl"
};
struct TablePush {
  SplatTableArray splats;
};
struct Gather {
  const TablePush& push;
#include "stage/gather_splats.glsl"
};

/// Beams with any sections, from points to slivers, on a plane that stands askew.
class Beams {
 public:
  static constexpr uint32_t count = 2000, lights = 2;

  explicit Beams(uint32_t seed)
      : random_(seed), beams_(count), words_(splat_heads + splat_words_per_head * buckets + splat_entries_per_beam * count) {
    surface_.geometric_normal = normalize(vec3(0.3f, -0.2f, 1.0f));
    surface_.coordinate_size = 1.0f;
    const BeamSource source{.least_level = -9};
    BeamPush push{};
    push.sources = reinterpret_cast<uint64_t>(&source);
    Follow stage{push};
    for (uint32_t i = 0; i < count; ++i) {
      Beam& p = beams_[i];
      p = {};
      p.direction = normalize(vec3(between(-0.7f, 0.7f), between(-0.7f, 0.7f), -1.0f));
      const float size = std::pow(10.0f, between(-3.5f, -0.8f)), aspect = std::pow(10.0f, between(0.0f, 2.0f));
      const Frame f = frame_around(p.direction);
      const float turn = between(0.0f, 6.3f), lean = between(-0.5f, 0.5f);
      p.position_u = (f.tangent * std::cos(turn) + f.bitangent * std::sin(turn)) * size;
      p.position_v = (f.bitangent * std::cos(turn + lean) - f.tangent * std::sin(turn + lean)) * (size / aspect);
      p.gain = vec3(1.0f);
      p.weight = 1.0f;
      p.length_m = 1.0f;
      p.light = i % lights;
      surface_.position = point();
      stage.splat(p, i, surface_);
    }
    table_.beams.at = beams_.data();
    table_.words.at = words_.data();
    table_.buckets = buckets;
    table_.beam_count = count;
    table_.entries = splat_entries_per_beam * count;
    for (uint32_t step = 0; step < splat_steps; ++step) {
      const SplatTablePush table{.table = reinterpret_cast<uint64_t>(&table_), .step = step};
      TableSteps steps{table};
      for (uint32_t i = std::max(buckets, count); i-- > 0;) steps.table_step(i);  // backwards: the order does not matter
    }
  }
  Beams(const Beams&) = delete;
  Beams& operator=(const Beams&) = delete;

  /// A point of the plane.
  vec3 point() {
    const float x = between(-0.5f, 0.5f), y = between(-0.5f, 0.5f);
    const vec3 n = surface_.geometric_normal;
    return {x, y, -(n.x * x + n.y * y) / n.z};
  }
  [[nodiscard]] float in_table(const vec3& at, uint32_t light) const {
    const TablePush push{reinterpret_cast<uint64_t>(&table_)};
    return Gather{push}.gather_about(at, light, 0, 0.5f).total;
  }
  [[nodiscard]] float in_all(const vec3& at, uint32_t light) const {
    const TablePush push{reinterpret_cast<uint64_t>(&table_)};
    Gather gather{push};
    float total = 0, random = 0.5f;
    Gather::Gathered found{};
    for (const Beam& p : beams_) {
      vec2 place;
      if ((p.state & beam_landed) == 0 || p.light != light || !gather.find_in_section(p, at, place)) continue;
      gather.weigh_beam(p, place, found, random);
      total = found.total;
    }
    return total;
  }

 private:
  float between(float low, float high) { return std::uniform_real_distribution<float>(low, high)(random_); }

  static constexpr uint32_t buckets = 512;  // few: cells share them
  std::mt19937 random_;
  Surface surface_{};
  std::vector<Beam> beams_;
  std::vector<uint32_t> words_;
  SplatTable table_{};
};

TEST(Splats, a_point_finds_all_beams_that_cover_it_once) {
  Beams beams(1);
  double found = 0;
  for (int i = 0; i < 4000; ++i) {
    const vec3 at = beams.point();
    for (uint32_t light = 0; light < Beams::lights; ++light) {
      const float all = beams.in_all(at, light);
      EXPECT_NEAR(beams.in_table(at, light), all, 1e-4f * all);
      found += all > 0 ? 1 : 0;
    }
  }
  EXPECT_GT(found, 4000);
}

/// Whether the grids of the sources have a node on each side of the way to a corner of the box, wherever in a step the grid stands.
void expect_covered(const BeamSources& sources, const SharpLight& light, const GlassBody& body) {
  for (int corner = 0; corner < 8; ++corner) {
    const vec3 at(corner & 1 ? body.max.x : body.min.x, corner & 2 ? body.max.y : body.min.y, corner & 4 ? body.max.z : body.min.z);
    bool covered = false;
    for (const BeamSource& s : sources.sources) {
      const vec3 way = at - s.origin;
      const float along = dot(way, s.axis);
      if (along <= 0) continue;
      const vec2 place = vec2(dot(way, s.axis_u), dot(way, s.axis_v)) / (light.directional ? 1.0f : along);
      const vec2 node = (place - s.first) / s.step;
      const auto rows = float(s.columns);
      covered = covered || (node.x >= 0.999f && node.y >= 0.999f && node.x <= float(s.columns) - 0.999f && node.y <= rows - 0.999f);
    }
    EXPECT_TRUE(covered) << corner;
  }
}

TEST(Splats, grids_cover_the_glass_from_afar_from_near_and_from_inside) {
  const GlassBody body{.min = glm::dvec3(-0.1, 0.2, 0.9), .max = glm::dvec3(0.3, 0.4, 1.1), .slot = 3, .environment = none};
  for (const SharpLight& light : {SharpLight{0, 0, false, {0, 0, 0}, {}}, SharpLight{0, 0, false, {0.31f, 0.3f, 1.0f}, {}},
                                  SharpLight{0, 0, false, {0.1f, 0.3f, 1.0f}, {}}, SharpLight{0, 0, true, {}, normalize(vec3(1, 2, 3))}}) {
    const BeamSources sources = make_beam_sources({light}, {body}, 2.0, 1, 4096);
    EXPECT_NEAR(sources.beam_count, 4096, 1500);
    expect_covered(sources, light, body);
  }
}

TEST(Splats, a_body_of_another_environment_has_no_beams) {
  const GlassBody body{.min = glm::dvec3(-1), .max = glm::dvec3(1), .slot = 0, .environment = 1};
  const SharpLight light{0, 0, false, {0, 0, -5}, {}};
  EXPECT_EQ(make_beam_sources({light}, {body}, 2.0, 2, 4096).beam_count, 0u);
}

}  // namespace
}  // namespace kuafu
