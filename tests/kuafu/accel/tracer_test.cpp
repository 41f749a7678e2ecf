// SPDX-License-Identifier: Apache-2.0
// All tracers, and both queue layouts of our own, against brute force in double precision and against each other.
#include "accel/tracer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>

#include "device/error.h"
#include "kuafu/accel/worlds.h"

namespace kuafu::test {
namespace {

constexpr double slack = 1e-4;  // barycentric, and relative to t: nearer to an edge than this, a ray may go either way

struct Maker {
  const char* name;
  std::unique_ptr<Tracer> (*make)();
  uint64_t capabilities = 0;  // that the device must have
};
void PrintTo(const Maker& maker, std::ostream* out) { *out << maker.name; }

bool can_make(const Maker& maker) { return (test_device()->info().capabilities & maker.capabilities) == maker.capabilities; }

std::string why_not(const Maker& maker) {
  return std::string(test_device()->info().driver) + " has no ray tracing pipelines, which " + maker.name +
         " needs; to run this on a lavapipe that has: bash tests/support/rt_mesa.sh build/bin/kuafu_accel_tests";
}

const Maker makers[] = {{"Embree", [] { return make_embree_tracer(test_device()); }},
                        {"ComputePlanes", [] { return make_compute_tracer(test_device()); }},
                        {"ComputePackets", [] { return make_compute_tracer(test_device(), queue_layout_packets); }},
                        {"RtPipeline", [] { return make_rt_tracer(test_device()); }, KS_CAP_RAY_TRACING_PIPELINE}};

class Tracers : public testing::TestWithParam<Maker> {
 protected:
  void SetUp() override {
    if (!can_make(GetParam())) GTEST_SKIP() << why_not(GetParam());
    std::unique_ptr<Tracer>& made = tracers_[GetParam().name];
    if (made == nullptr) made = GetParam().make();
    tracer_ = made.get();
    bench_.emplace(*tracer_);
  }
  static void TearDownTestSuite() { tracers_.clear(); }

  // Made once, for some compile shaders; each goes from scene to scene.
  static inline std::map<std::string, std::unique_ptr<Tracer>> tracers_;
  Tracer* tracer_ = nullptr;
  std::optional<RayBench> bench_;

  /// The triangle named is really hit, where t, u and v say, and no triangle that is surely hit is nearer.
  static bool is_nearest(const TestHit& hit, const BruteForce& truth, const TestRay& ray) {
    const double sure = truth.nearest(ray, -slack);
    if (!hit.hit) return std::isinf(sure);
    const double t = truth.distance_to(hit, ray, slack), reach = std::max(1.0, t);
    const glm::dvec3 at = glm::dvec3(ray.origin) + t * glm::dvec3(ray.direction);
    return std::abs(t - hit.t) <= slack * reach && hit.t <= sure + slack * reach && glm::length(truth.point(hit) - at) <= slack * reach;
  }

  void expect_like_brute_force(const Scene& scene, const std::vector<TestRay>& rays) {
    const BruteForce truth(scene);
    const std::vector<TestHit> hits = bench_->closest(rays);
    EXPECT_TRUE(bench_->tail_untouched(uint32_t(rays.size())));
    const std::vector<bool> occluded = bench_->occluded(rays);
    EXPECT_TRUE(bench_->tail_untouched(uint32_t(rays.size())));
    size_t wrong_hits = 0, wrong_shadows = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      wrong_hits += !is_nearest(hits[i], truth, rays[i]);
      const bool surely = std::isfinite(truth.nearest(rays[i], -slack)), perhaps = std::isfinite(truth.nearest(rays[i], slack));
      wrong_shadows += occluded[i] ? !perhaps : surely;
    }
    EXPECT_EQ(wrong_hits, 0u) << "of " << rays.size();
    EXPECT_EQ(wrong_shadows, 0u) << "of " << rays.size();
  }

  /// Brings the tracer up to date: it finds, bit for bit, what one finds that was made for the scene as it is. Returns the hits.
  std::vector<TestHit> expect_like_new(const Scene& scene, uint32_t environments, const std::vector<TestRay>& rays, const char* when) {
    tracer_->update(scene, environments, {});
    const auto fresh = GetParam().make();
    fresh->update(scene, environments, {});
    RayBench expected(*fresh);
    std::vector<TestHit> hits = bench_->closest(rays);
    EXPECT_EQ(hits, expected.closest(rays)) << when;
    EXPECT_EQ(bench_->occluded(rays), expected.occluded(rays)) << when;
    return hits;
  }
};

/// Random rays, each of one of the environments.
std::vector<TestRay> rays_of_environments(uint32_t environments, uint32_t seed, uint32_t count, double half, Random& random) {
  std::vector<TestRay> rays = random_rays(seed, count, half);
  for (TestRay& ray : rays) ray.environment = random.below(environments);
  return rays;
}

std::vector<uint32_t> first_ids(uint32_t count) {
  std::vector<uint32_t> ids(count);
  std::iota(ids.begin(), ids.end(), 0u);
  return ids;
}

size_t count_hits(const std::vector<TestHit>& hits) {
  return size_t(std::ranges::count_if(hits, [](const TestHit& hit) { return hit.hit; }));
}

TEST_P(Tracers, RotatedMirroredAndStretchedInstancesMatchBruteForce) {
  const Scene scene = instanced_world(3, 24, 3.0);
  tracer_->update(scene, 1, {});
  const std::vector<TestRay> rays = random_rays(4, 4003, 4.0);
  EXPECT_GT(count_hits(bench_->closest(rays)), rays.size() / 5);
  expect_like_brute_force(scene, rays);
}

TEST_P(Tracers, IntervalIsHonoured) {
  const Scene scene = instanced_world(5, 12, 2.0);
  tracer_->update(scene, 1, {});
  std::vector<TestRay> rays = random_rays(6, 3000, 3.0);
  Random random(7);
  for (TestRay& ray : rays) {
    ray.t_near = float(random.uniform(0.0, 2.0));
    ray.t_far = ray.t_near + float(random.uniform(0.0, 2.0));
  }
  expect_like_brute_force(scene, rays);
}

TEST_P(Tracers, RaysThatAreNotFiniteOrFromBeyondTheWorldSpareTheOthers) {
  const Scene scene = instanced_world(5, 12, 2.0);
  tracer_->update(scene, 1, {});
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<TestRay> rays = random_rays(8, 64, 3.0);
  const std::vector<TestRay> sane = rays;
  const glm::vec3 wrong[] = {{nan, 0, 0}, {0, inf, 0}, {0, 0, -inf}, {1e38f, 0, 0}};
  for (size_t i = 0; i < rays.size(); i += 2) (i % 4 ? rays[i].origin : rays[i].direction) = i % 4 ? wrong[i / 4 % 4] : wrong[i / 4 % 3];
  const std::vector<TestHit> expected = bench_->closest(sane), hits = bench_->closest(rays);
  const std::vector<bool> occluded = bench_->occluded(rays);
  for (size_t i = 1; i < rays.size(); i += 2) {
    EXPECT_EQ(hits[i], expected[i]) << i;
    EXPECT_EQ(occluded[i], expected[i].hit) << i;
  }
}

TEST_P(Tracers, BarycentricsBelongToVerticesOneAndTwo) {
  Scene scene;
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.indices = {{0, 1, 2}};
  scene.add_instance(place(scene.add_mesh(mesh), pose({0.0, 0.0, 3.0})));
  tracer_->update(scene, 1, {});
  const std::vector<TestHit> hits = bench_->closest({{{0.5f, 0.25f, 0.0f}}, {{0.6f, 0.6f, 0.0f}}, {{0.2f, 0.2f, 4.0f}, 0.0f, {0, 0, -1}}});
  EXPECT_NEAR(hits[0].t, 3.0, 1e-6);
  EXPECT_NEAR(hits[0].u, 0.5, 1e-6);
  EXPECT_NEAR(hits[0].v, 0.25, 1e-6);
  EXPECT_FALSE(hits[1].hit);
  EXPECT_TRUE(hits[2].hit) << "the back face counts";
}

TEST_P(Tracers, EmptySceneAndEmptyQueueAreHarmless) {
  Scene scene;
  tracer_->update(scene, 1, {});
  EXPECT_EQ(count_hits(bench_->closest(random_rays(8, 13, 1.0))), 0u);
  EXPECT_TRUE(bench_->closest({}).empty());
  EXPECT_TRUE(bench_->occluded({}).empty());
  EXPECT_TRUE(bench_->tail_untouched(0));
}

TEST_P(Tracers, DegenerateTrianglesAndFlattenedInstancesAreNeverHit) {
  Scene scene;
  Mesh line, point;
  line.positions = {{-1, 0, 2}, {1, 0, 2}, {0, 0, 2}};
  line.indices = {{0, 1, 2}, {0, 0, 1}};
  point.positions = {{0, 0, 2}};
  point.indices = {{0, 0, 0}};
  scene.add_instance(place(scene.add_mesh(line)));
  scene.add_instance(place(scene.add_mesh(point)));
  tracer_->update(scene, 1, {});
  std::vector<TestRay> rays = random_rays(9, 500, 0.2);
  for (TestRay& ray : rays) ray.origin.y = 0.0f, ray.direction = glm::normalize(glm::vec3(ray.direction.x * 0.1f, 0.0f, 1.0f));
  EXPECT_EQ(count_hits(bench_->closest(rays)), 0u);
}

TEST_P(Tracers, NoRayLeavesAClosedMesh) {
  Scene scene;
  const Mesh mesh = sphere(40);
  scene.add_instance(place(scene.add_mesh(mesh), pose({0.3, -0.2, 0.1}, {1.0, 0.7, 1.3}, 0.4, {0.6, 0.8, 0.0})));
  tracer_->update(scene, 1, {});
  // Half of them aim at edges, where cracks would be.
  std::vector<TestRay> rays = random_rays(10, 60000, 0.1);
  Random random(11);
  for (size_t i = 0; i < rays.size(); i += 2) {
    const glm::uvec3 corners = mesh.indices[random.below(uint32_t(mesh.indices.size()))];
    const glm::vec3 target = glm::mix(mesh.positions[corners.x], mesh.positions[corners.y], float(random.uniform()));
    const glm::vec3 world(scene.instances()[0].local_to_world * glm::dvec4(target, 1.0));
    rays[i].direction = glm::normalize(world - rays[i].origin);
  }
  EXPECT_EQ(count_hits(bench_->closest(rays)), rays.size());
}

TEST_P(Tracers, AxisParallelRaysSeeFlatMeshes) {
  Scene scene;
  Mesh wall;
  wall.positions = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  wall.indices = {{0, 1, 2}, {0, 2, 3}};
  scene.add_instance(place(scene.add_mesh(wall), pose({0.0, 0.0, 1.37})));
  tracer_->update(scene, 1, {});
  std::vector<TestRay> rays;
  for (int i = -50; i <= 50; ++i) rays.push_back({{0.019f * float(i), 0.019f * float(i), -0.3f}});  // along the diagonal, exactly
  for (int i = -50; i <= 50; ++i) rays.push_back({{0.019f * float(i), 0.0f, -0.3f}});
  EXPECT_EQ(count_hits(bench_->closest(rays)), rays.size());
}

TEST_P(Tracers, TenThousandInstancesMatchBruteForce) {
  const Scene scene = instanced_world(12, 10000, 40.0);
  tracer_->update(scene, 1, {});
  expect_like_brute_force(scene, random_rays(13, 20, 40.0));
}

TEST_P(Tracers, EnvironmentsInOneQueueSeeTheirOwnInstancesAndTheShared) {
  Random random(14);
  Scene scene;
  const uint32_t mesh = scene.add_mesh(soup(random, 50, 0.4));
  const uint32_t environments = 5;
  for (uint32_t i = 0; i < 30; ++i) {
    const uint32_t environment = i % 6 == 5 ? none : i % 6;  // 3 and 4 of each six are alike but for the environment
    scene.add_instance(place(mesh, random_pose(random, 2.0), environment));
  }
  scene.add_instance(place(mesh, pose({0.0, 0.0, 0.0}), environments + 2));  // of an environment that is not rendered
  tracer_->update(scene, environments, {});
  std::vector<TestRay> rays = random_rays(15, 3005, 2.5);
  for (TestRay& ray : rays) ray.environment = random.below(environments);
  expect_like_brute_force(scene, rays);

  for (TestRay& ray : rays) ray.environment = 7;
  EXPECT_EQ(count_hits(bench_->closest(rays)), 0u) << "rays of an environment beyond the count see nothing";
}

TEST_P(Tracers, AnEmptiedSceneAndAnotherSceneAreFollowed) {
  Scene scene = instanced_world(16, 20, 2.0);
  const std::vector<TestRay> rays = random_rays(17, 1500, 3.0);
  tracer_->update(scene, 1, {});
  EXPECT_GT(count_hits(bench_->closest(rays)), 0u);
  for (uint32_t id = 0; id < 20; ++id) scene.remove_instance(id);
  tracer_->update(scene, 3, {});
  EXPECT_EQ(count_hits(bench_->closest(rays)), 0u);

  const Scene other = instanced_world(19, 5, 1.0);
  tracer_->update(other, 1, {});
  expect_like_brute_force(other, rays);
}

/// Moves, removes and adds instances of the scene.
void change_some(Scene& scene, std::vector<uint32_t>& ids, uint32_t changes, double half, Random& random) {
  for (; changes > 0; --changes) {
    const uint32_t which = random.below(uint32_t(ids.size()));
    const double kind = random.uniform();
    if (kind < 0.5) {
      scene.set_instance_pose(ids[which], random_pose(random, half));
    } else if (kind < 0.7) {
      scene.remove_instance(ids[which]);
      ids.erase(ids.begin() + which);
    } else {
      ids.push_back(scene.add_instance(place(random.below(3), random_pose(random, half), kind < 0.8 ? none : random.below(4))));
    }
  }
}

TEST_P(Tracers, AnySequenceOfSmallChangesMatchesBruteForce) {
  Random random(40);
  Scene scene = instanced_world(41, 60, 3.0);
  const std::vector<TestRay> rays = rays_of_environments(3, 42, 120, 4.0, random);
  std::vector<uint32_t> ids = first_ids(60);
  for (int round = 0; round < 30; ++round) {
    change_some(scene, ids, random.below(6), 3.0, random);
    tracer_->update(scene, 3, {});
    expect_like_brute_force(scene, rays);
  }
}

TEST_P(Tracers, ALargeSceneAfterFewAndManyChangesIsOneThatWasMadeSo) {
  Random random(45);
  Scene scene = instanced_world(46, 700, 8.0);
  const std::vector<TestRay> rays = rays_of_environments(3, 47, 700, 8.0, random);
  std::vector<uint32_t> ids = first_ids(700);
  tracer_->update(scene, 3, {});
  for (const uint32_t changes : {1u, 40u, 160u, 260u, 3u}) {
    change_some(scene, ids, changes, 8.0, random);
    const std::string when = "after " + std::to_string(changes) + " changes";
    EXPECT_GT(count_hits(expect_like_new(scene, 3, rays, when.c_str())), rays.size() / 4);
  }
}

TEST_P(Tracers, RemovedMeshesAreForgottenAndTheirNeighboursStay) {
  Random random(43);
  Scene scene;
  const std::vector<TestRay> rays = random_rays(44, 500, 3.0);
  std::vector<uint32_t> meshes, instances;
  for (int i = 0; i < 4; ++i) {
    meshes.push_back(scene.add_mesh(soup(random, 30, 0.5)));
    instances.push_back(scene.add_instance(place(meshes.back(), random_pose(random, 1.0))));
  }
  tracer_->update(scene, 1, {});
  expect_like_brute_force(scene, rays);
  scene.remove_instance(instances[1]);
  scene.remove_mesh(meshes[1]);
  scene.remove_mesh(scene.add_mesh(soup(random, 10, 0.5)));  // gone before anyone saw it
  scene.add_instance(place(meshes[2], random_pose(random, 1.0)));
  tracer_->update(scene, 1, {});
  expect_like_brute_force(scene, rays);
  shake(scene, meshes[3], random, 0.2);
  scene.add_instance(place(scene.add_mesh(soup(random, 30, 0.5)), random_pose(random, 1.0)));
  tracer_->update(scene, 1, {});
  expect_like_brute_force(scene, rays);
}

TEST_P(Tracers, DeformedMeshesMatchBruteForce) {
  Scene scene = instanced_world(30, 20, 2.0);
  const std::vector<TestRay> rays = random_rays(31, 1000, 3.0);
  Random random(32);
  tracer_->update(scene, 1, {});
  for (const double reach : {0.01, 0.2, 3.0, 0.5}) {  // the third leaves nothing of the tree's order
    shake(scene, 0, random, reach);
    if (reach < 1.0) shake(scene, 1, random, reach);
    tracer_->update(scene, 1, {});
    expect_like_brute_force(scene, rays);
  }
  // All kinds of change at once.
  shake(scene, 1, random, 0.1);
  scene.set_instance_pose(3, pose({0.3, 0.1, -0.2}, {-1.0, 1.0, 0.5}));
  scene.remove_instance(4);
  scene.add_instance(place(scene.add_mesh(soup(random, 20, 0.4))));
  tracer_->update(scene, 2, {});
  expect_like_brute_force(scene, rays);
}

TEST_P(Tracers, AMeshMayDeformForever) {
  Scene scene;
  Random random(33);
  scene.add_instance(place(scene.add_mesh(soup(random, 200, 0.2))));
  for (int round = 0; round < 80; ++round) {
    tracer_->update(scene, 1, {});
    shake(scene, 0, random, 0.1);
  }
  tracer_->update(scene, 1, {});
  expect_like_brute_force(scene, random_rays(34, 2000, 3.0));
}

TEST_P(Tracers, DeformationCostsWhatTheMeshIsLargeNotTheScene) {
  if (tracer_->name() == std::string("embree"))
    GTEST_SKIP() << "Embree follows meshes in memory of its own: nothing is copied that could be counted";
  Scene scene;
  Random random(35);
  const uint32_t large = scene.add_mesh(sphere(160)), small = scene.add_mesh(sphere(6));  // 102 400 and 144 triangles
  scene.add_instance(place(large));
  scene.add_instance(place(small));
  tracer_->update(scene, 1, {});
  const auto copied_bytes = [&](uint32_t mesh) {
    uint64_t before = 0;
    for (int i = 0; i < 3; ++i) {  // a mesh that deforms the first time gets memory of its own
      shake(scene, mesh, random, 1e-3);
      before = test_device()->copied_bytes();
      tracer_->update(scene, 1, {});
    }
    return test_device()->copied_bytes() - before;
  };
  const uint64_t small_bytes = copied_bytes(small), large_bytes = copied_bytes(large);
  EXPECT_GE(large_bytes, 102400u * 3 * sizeof(float)) << "at least its vertices";
  EXPECT_LT(small_bytes, large_bytes / 200) << "a seven-hundredth of the triangles";
}

TEST_P(Tracers, AnAnswerDoesNotDependOnTheNeighboursInTheQueue) {
  const Scene scene = instanced_world(20, 40, 3.0);
  tracer_->update(scene, 1, {});
  const std::vector<TestRay> rays = camera_rays(200, {0.0f, 0.0f, -6.0f});  // coherent in order, incoherent when shuffled
  const std::vector<TestHit> in_order = bench_->closest(rays);

  std::vector<uint32_t> order(rays.size());
  Random random(22);
  for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  for (uint32_t i = 0; i < order.size(); ++i) std::swap(order[i], order[random.below(uint32_t(order.size()))]);
  std::vector<TestRay> shuffled;
  for (const uint32_t i : order) shuffled.push_back(rays[i]);
  const std::vector<TestHit> out_of_order = bench_->closest(shuffled);
  size_t different = 0;
  for (size_t i = 0; i < order.size(); ++i) different += out_of_order[i] != in_order[order[i]];
  EXPECT_EQ(different, 0u) << "of " << rays.size();
  EXPECT_EQ(bench_->closest(rays, true), in_order) << "nor on the hint that they are coherent";
}

TEST_P(Tracers, MisuseIsAnError) {
  const Scene scene;
  EXPECT_THROW(tracer_->update(scene, 0, {}), ks::Error);
  const auto fresh = GetParam().make();
  EXPECT_THROW(RayBench(*fresh).closest(random_rays(23, 8, 1.0)), ks::Error) << "no scene yet";
}

INSTANTIATE_TEST_SUITE_P(All, Tracers, testing::ValuesIn(makers), [](const auto& info) { return std::string(info.param.name); });

/// Against the first of the list, ray by ray.
class TracersTogether : public testing::TestWithParam<Maker> {};

TEST_P(TracersTogether, AgreeOnMoreThan9999Of10000Rays) {
  if (!can_make(GetParam())) GTEST_SKIP() << why_not(GetParam());
  const Scene scene = instanced_world(24, 60, 3.0);
  const std::vector<TestRay> rays = random_rays(25, 50000, 4.0);
  const auto first = makers[0].make(), second = GetParam().make();
  first->update(scene, 1, {});
  second->update(scene, 1, {});
  const std::vector<TestHit> a = RayBench(*first).closest(rays), b = RayBench(*second).closest(rays);
  const std::vector<bool> shadow_a = RayBench(*first).occluded(rays), shadow_b = RayBench(*second).occluded(rays);
  size_t different = 0, different_shadow = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    const bool alike = a[i].hit == b[i].hit && a[i].instance == b[i].instance && a[i].primitive == b[i].primitive &&
                       std::abs(a[i].t - b[i].t) <= slack * std::max(1.0f, a[i].t) && std::abs(a[i].u - b[i].u) < 1e-3f &&
                       std::abs(a[i].v - b[i].v) < 1e-3f;
    different += !alike;
    different_shadow += shadow_a[i] != shadow_b[i];
  }
  RecordProperty("different_of_50000", int(different));
  EXPECT_LT(different, rays.size() / 10000);
  EXPECT_LT(different_shadow, rays.size() / 10000);
}

INSTANTIATE_TEST_SUITE_P(WithEmbree, TracersTogether, testing::ValuesIn(makers + 1, std::end(makers)),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace kuafu::test
