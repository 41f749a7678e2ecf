// SPDX-License-Identifier: Apache-2.0
// The table of landed pencils, on the shaders' text compiled as C++: a point finds the pencils that cover it, each once, whatever their
// sections are; and the grids of pencils cover the glass.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "frame/host_language.h"
#include "tables/pencil_sources.h"

#define KUAFU_CHANNELS 3
namespace kuafu {
namespace {

constexpr uint features = 0u;
#include "lib/landing.glsl"
#include "lib/refraction.glsl"
#include "lib/shading.glsl"

struct Land {
  const LandPush& push;
#include "stage/land.glsl"
};
struct TableSteps {
  const LandingTablePush& push;
#include "stage/landing_table.glsl"
};
struct TablePush {
  LandingTableArray landings;
};
struct Landed {
  const TablePush& push;
#include "stage/landed.glsl"
};

/// Pencils with any sections, from points to slivers, on a plane that stands askew.
class Pencils {
 public:
  static constexpr uint32_t count = 2000, lights = 2;

  explicit Pencils(uint32_t seed)
      : random_(seed), pencils_(count), words_(landing_heads + landing_words_per_head * buckets + landing_entries_per_pencil * count) {
    surface_.geometric_normal = normalize(vec3(0.3f, -0.2f, 1.0f));
    surface_.coordinate_size = 1.0f;
    const PencilSource source{.least_level = -9};
    LandPush push{};
    push.sources = reinterpret_cast<uint64_t>(&source);
    Land stage{push};
    for (uint32_t i = 0; i < count; ++i) {
      Pencil& p = pencils_[i];
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
      stage.land(p, i, surface_);
    }
    table_.pencils.at = pencils_.data();
    table_.words.at = words_.data();
    table_.buckets = buckets;
    table_.pencil_count = count;
    table_.entries = landing_entries_per_pencil * count;
    for (uint32_t step = 0; step < landing_steps; ++step) {
      const LandingTablePush table{.table = reinterpret_cast<uint64_t>(&table_), .step = step};
      TableSteps steps{table};
      for (uint32_t i = std::max(buckets, count); i-- > 0;) steps.table_step(i);  // backwards: the order does not matter
    }
  }
  Pencils(const Pencils&) = delete;
  Pencils& operator=(const Pencils&) = delete;

  /// A point of the plane.
  vec3 point() {
    const float x = between(-0.5f, 0.5f), y = between(-0.5f, 0.5f);
    const vec3 n = surface_.geometric_normal;
    return {x, y, -(n.x * x + n.y * y) / n.z};
  }
  [[nodiscard]] float in_table(const vec3& at, uint32_t light) const {
    const TablePush push{reinterpret_cast<uint64_t>(&table_)};
    return Landed{push}.gather_about(at, light, 0, 0.5f).total;
  }
  [[nodiscard]] float in_all(const vec3& at, uint32_t light) const {
    const TablePush push{reinterpret_cast<uint64_t>(&table_)};
    Landed landed{push};
    float total = 0, random = 0.5f;
    Landed::Gathered found{};
    for (const Pencil& p : pencils_) {
      vec2 place;
      if ((p.state & pencil_landed) == 0 || p.light != light || !landed.find_in_section(p, at, place)) continue;
      landed.weigh_pencil(p, place, found, random);
      total = found.total;
    }
    return total;
  }

 private:
  float between(float low, float high) { return std::uniform_real_distribution<float>(low, high)(random_); }

  static constexpr uint32_t buckets = 512;  // few: cells share them
  std::mt19937 random_;
  Surface surface_{};
  std::vector<Pencil> pencils_;
  std::vector<uint32_t> words_;
  LandingTable table_{};
};

TEST(Landing, a_point_finds_all_pencils_that_cover_it_once) {
  Pencils pencils(1);
  double found = 0;
  for (int i = 0; i < 4000; ++i) {
    const vec3 at = pencils.point();
    for (uint32_t light = 0; light < Pencils::lights; ++light) {
      const float all = pencils.in_all(at, light);
      EXPECT_NEAR(pencils.in_table(at, light), all, 1e-4f * all);
      found += all > 0 ? 1 : 0;
    }
  }
  EXPECT_GT(found, 4000);
}

/// Whether the grids of the sources have a node on each side of the way to a corner of the box, wherever in a step the grid stands.
void expect_covered(const PencilSources& sources, const SharpLight& light, const GlassBody& body) {
  for (int corner = 0; corner < 8; ++corner) {
    const vec3 at(corner & 1 ? body.max.x : body.min.x, corner & 2 ? body.max.y : body.min.y, corner & 4 ? body.max.z : body.min.z);
    bool covered = false;
    for (const PencilSource& s : sources.sources) {
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

TEST(Landing, grids_cover_the_glass_from_afar_from_near_and_from_inside) {
  const GlassBody body{.min = glm::dvec3(-0.1, 0.2, 0.9), .max = glm::dvec3(0.3, 0.4, 1.1), .slot = 3, .environment = none};
  for (const SharpLight& light : {SharpLight{0, 0, false, {0, 0, 0}, {}}, SharpLight{0, 0, false, {0.31f, 0.3f, 1.0f}, {}},
                                  SharpLight{0, 0, false, {0.1f, 0.3f, 1.0f}, {}}, SharpLight{0, 0, true, {}, normalize(vec3(1, 2, 3))}}) {
    const PencilSources sources = make_pencil_sources({light}, {body}, 2.0, 1, 4096);
    EXPECT_NEAR(sources.pencil_count, 4096, 1500);
    expect_covered(sources, light, body);
  }
}

TEST(Landing, a_body_of_another_environment_has_no_pencils) {
  const GlassBody body{.min = glm::dvec3(-1), .max = glm::dvec3(1), .slot = 0, .environment = 1};
  const SharpLight light{0, 0, false, {0, 0, -5}, {}};
  EXPECT_EQ(make_pencil_sources({light}, {body}, 2.0, 2, 4096).pencil_count, 0u);
}

}  // namespace
}  // namespace kuafu
