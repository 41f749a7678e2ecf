// SPDX-License-Identifier: Apache-2.0
// Samples: bits, seeds, pixels, tracers, and the size of an estimate.
#include <cmath>
#include <random>

#include "kuafu/world.h"

namespace laws {
namespace {

void furnish(World& world) {
  world.add(quad({0, 0, 1.2}, {-1, 0, 0}, {0, 1, 0}), lambert(0.6f));
  world.add(quad({0, 0.3, 0.8}, {-1, 0, 0}, {0, 0, -0.5}), lambert(0.7f));
  world.add(sphere(0.15, 16, true, {-0.2, 0.1, 0.8}), metal(0.4f));
  world.add(sphere(0.15, 16, true, {0.2, 0.1, 0.7}), glass(1.5f));
  world.add_projector(dotted(64 * 64), 64, 64, 50, 1.0f, placed({0.05, 0, 0}));
  world.set_environment(0.1f);
}

const kuafu_view_desc left = view_at({0, 0, 0}, 67, 41, 60), right = view_at({0.05, 0, 0}, 67, 41, 60);

TEST(Sampling, same_bits_for_any_number_of_workers) {
  std::vector<float> images[2];
  for (const uint32_t workers : {1u, 2u}) {
    World world(KUAFU_TRACER_AUTO, workers);
    furnish(world);
    images[workers - 1] = world.radiance(left).values;
  }
  EXPECT_EQ(images[0], images[1]);
}

// A CPU device computes BSDFs in lanes, unless some surface has one that lanes do not know, as one of rough diffuse that nobody sees here.
TEST(Sampling, a_surface_that_no_ray_meets_changes_nothing) {
  for (const bool lights_with_an_extent : {false, true}) {
    std::vector<float> images[2];
    for (const bool with_another : {false, true}) {
      World world;
      furnish(world);
      if (lights_with_an_extent) {
        world.add_light(rectangle_light(2, 0.3, 0.3), placed({-0.3, -0.6, 0.4}));
        world.add_light(light_of(KUAFU_LIGHT_POINT, 1, 0.1), placed({0.4, -0.5, 0.5}));
      }
      kuafu_material_desc rough = lambert(0.5f);
      rough.diffuse_roughness = 0.5f;
      if (with_another) world.add(sphere(0.1, 8, true, {0, 0, -500}), rough);
      images[with_another ? 1 : 0] = world.radiance(left).values;
    }
    // Lanes have a sine of their own, which sends a ray to the other side of an edge once in a while.
    int off = 0;
    for (size_t i = 0; i < images[0].size(); ++i) off += std::abs(images[0][i] - images[1][i]) > 1e-3f * (0.01f + images[0][i]) ? 1 : 0;
    EXPECT_LE(off, int(images[0].size() / 500)) << lights_with_an_extent;
  }
}

TEST(Sampling, views_together_give_the_bits_of_each_alone) {
  World world;
  furnish(world);
  const Pixels together = world.render({left, right}, {KUAFU_OUTPUT_RADIANCE})[KUAFU_OUTPUT_RADIANCE];
  const Pixels a = world.radiance(left), b = world.radiance(right);
  std::vector<float> alone = a.values;
  alone.insert(alone.end(), b.values.begin(), b.values.end());
  EXPECT_EQ(together.values, alone);
}

TEST(Sampling, cameras_draw_different_noise) {
  // Both cameras see a plane lit by interreflection alone; equal noise would make the images equal up to parallax.
  World world;
  world.add(box({50, 50, 50}), emitter(1.0f));
  world.add(quad({0, 0, 2}, {-20, 0, 0}, {0, 20, 0}), lambert(0.5f));
  kuafu_material_desc spot = emitter(5.0f);
  world.add(quad({0, 0, -1}, {0.5, 0, 0}, {0, 0.5, 0}), spot);
  world.desc().samples_per_pixel = 4;
  const Pixels pair = world.render({left, right}, {KUAFU_OUTPUT_RADIANCE})[KUAFU_OUTPUT_RADIANCE];
  double mean = pair.mean(), covariance = 0, variance = 0;
  const size_t n = pair.values.size() / 2;
  for (size_t i = 0; i < n; ++i) {
    covariance += (pair.values[i] - mean) * (pair.values[n + i] - mean);
    variance += (pair.values[i] - mean) * (pair.values[i] - mean);
  }
  EXPECT_GT(variance, 0);
  EXPECT_LT(std::abs(covariance / variance), 0.1);
}

TEST(Sampling, first_sample_continues_the_sequence) {
  World world;
  furnish(world);
  world.desc().samples_per_pixel = 16;
  const Pixels all = world.radiance(left);
  world.desc().samples_per_pixel = 8;
  const Pixels first = world.radiance(left);
  world.desc().first_sample = 8;
  const Pixels second = world.radiance(left);
  for (size_t i = 0; i < all.values.size(); ++i)
    ASSERT_NEAR(all.values[i], (first.values[i] + second.values[i]) / 2, 1e-5f * (1 + all.values[i])) << i;
}

TEST(Sampling, pixels_integrate_a_box) {
  // An edge through a pixel: its value is the covered share, and the neighbours know nothing of it.
  for (const double share : {0.1, 0.5, 0.8}) {
    World world;
    const double edge_x = (share - 0.5) / 100;  // metres right of the axis at z = 1: a pixel is 10 mm
    world.add(quad({edge_x - 1, 0, 1}, {-1, 0, 0}, {0, 1, 0}), emitter(1.0f));
    const Pixels image = world.radiance(view_at({0, 0, 0}, 3, 3, 100), 256);
    EXPECT_NEAR(image.at(0, 1, 1), share, 0.005);
    EXPECT_EQ(image.at(0, 1, 0), 1.0f);
    EXPECT_EQ(image.at(0, 1, 2), 0.0f);
  }
}

TEST(Sampling, stratified_edges_beat_independent_samples) {
  // 64 independent samples leave sqrt(p (1 - p) / 64) = 0.06 on an edge; the scrambled sequence must be far below.
  World world;
  world.add(quad({-1, 0, 1}, {-1, 0, 0}, {0.3, 1, 0}), emitter(1.0f));
  world.desc().samples_per_pixel = 64;
  const Pixels image = world.radiance(view_at({0, 0, 0}, 9, 65, 100));
  const Pixels reference = world.radiance(view_at({0, 0, 0}, 9, 65, 100), 4096);
  double squares = 0;
  int count = 0;
  for (size_t i = 0; i < image.values.size(); ++i) {
    if (reference.values[i] < 0.05f || reference.values[i] > 0.95f) continue;
    squares += std::pow(image.values[i] - reference.values[i], 2);
    ++count;
  }
  ASSERT_GT(count, 20);
  EXPECT_LT(std::sqrt(squares / count), 0.02);
}

TEST(Estimator, many_seeds_at_four_samples_have_the_mean_of_many_samples) {
  World world;
  world.add(quad({0, 0.3, 1}, {-1, 0, 0}, {0, 0, -1}), lambert(0.7f));
  world.add(sphere(0.12, 12, true), metal(0.4f), placed({-0.2, 0.18, 1}));
  kuafu_material_desc frosted = glass(1.5f);
  frosted.transmission_roughness = 0.4f;
  world.add(sphere(0.12, 12, true), frosted, placed({0.2, 0.18, 1}));
  world.add(box({0.1, 0.02, 0.1}), emitter(3.0f), placed({0, -0.3, 1}));
  world.set_environment(0.1f);
  const kuafu_view_desc view = view_at({0, 0, 0}, 24, 24, 30);
  world.desc().samples_per_pixel = 4096;
  world.desc().seed = 12345;
  const double expected = world.radiance(view).mean();
  constexpr int seeds = 256;
  double sum = 0, squares = 0;
  for (int i = 0; i < seeds; ++i) {
    world.desc().seed = uint64_t(i);
    const double mean = world.radiance(view, 4).mean();
    sum += mean, squares += mean * mean;
  }
  const double mean = sum / seeds, error = std::sqrt((squares / seeds - mean * mean) / (seeds - 1));
  // The reference has 4 times as many samples as all seeds together: a quarter of their variance is added.
  EXPECT_NEAR(mean, expected, 4 * error * std::sqrt(1.25));
}

struct Triangle {
  Vec3 a, e1, e2, normal;
  double albedo, emission;
};

struct Hit {
  double t = 1e30;
  const Triangle* triangle = nullptr;
};

class Room {
 public:
  void add(World& world, const Shape& shape, double albedo, double emission = 0) {
    kuafu_material_desc m = lambert(float(albedo));
    m.ir_emission = float(emission);
    world.add(shape, m);
    for (size_t i = 0; i < shape.indices.size(); i += 3) {
      Vec3 p[3];
      for (size_t k = 0; k < 3; ++k)
        for (size_t c = 0; c < 3; ++c) p[k][c] = double(shape.positions[3 * shape.indices[i + k] + c]);
      const Vec3 e1 = p[1] - p[0], e2 = p[2] - p[0];
      triangles_.push_back({p[0], e1, e2, glm::normalize(glm::cross(e1, e2)), albedo, emission});
    }
  }

  /// Radiance along a ray: emission where the eye looks, and light of the lamp on bounces + 1 surfaces.
  double radiance(Vec3 origin, Vec3 direction, int bounces) {
    double sum = 0, throughput = 1;
    for (int bounce = 0; bounce <= bounces; ++bounce) {
      const Hit hit = closest(origin, direction);
      if (hit.triangle == nullptr) break;
      if (bounce == 0) sum += hit.triangle->emission;
      const Vec3 n = glm::faceforward(hit.triangle->normal, direction, hit.triangle->normal);
      origin = origin + direction * hit.t + n * 1e-9;
      throughput *= hit.triangle->albedo;
      sum += throughput / pi * irradiance(origin, n);
      direction = cosine_around(n);
    }
    return sum;
  }

 private:
  double random() { return uniform_(random_); }

  [[nodiscard]] Hit closest(const Vec3& origin, const Vec3& direction) const {
    Hit hit;
    for (const Triangle& t : triangles_) {  // Moeller and Trumbore 1997
      const Vec3 p = glm::cross(direction, t.e2), s = origin - t.a, q = glm::cross(s, t.e1);
      const double det = glm::dot(t.e1, p), u = glm::dot(s, p) / det, v = glm::dot(direction, q) / det, way = glm::dot(t.e2, q) / det;
      if (u >= 0 && v >= 0 && u + v <= 1 && way > 1e-9 && way < hit.t) hit = {way, &t};
    }
    return hit;
  }

  double irradiance(const Vec3& point, const Vec3& n) {
    double sum = 0;
    for (const Triangle& t : triangles_) {
      if (t.emission == 0) continue;
      const double root = std::sqrt(random()), v = random() * root;
      const Vec3 way = t.a + t.e1 * (1 - root) + t.e2 * v - point, d = glm::normalize(way);
      const double cos_here = glm::dot(d, n), area = 0.5 * glm::length(glm::cross(t.e1, t.e2));
      if (cos_here <= 0 || closest(point, d).triangle != &t) continue;
      sum += t.emission * cos_here * std::abs(glm::dot(d, t.normal)) * area / glm::dot(way, way);
    }
    return sum;
  }

  Vec3 cosine_around(const Vec3& n) {
    const double phi = 2 * pi * random(), r2 = random(), r = std::sqrt(r2);
    const Vec3 x = glm::normalize(glm::cross(std::abs(n[0]) > 0.5 ? Vec3{0, 1, 0} : Vec3{1, 0, 0}, n)), y = glm::cross(n, x);
    return x * (r * std::cos(phi)) + y * (r * std::sin(phi)) + n * std::sqrt(1 - r2);
  }

  std::vector<Triangle> triangles_;
  std::mt19937_64 random_{11};
  std::uniform_real_distribution<double> uniform_{0, 1};
};

TEST(Cornell, mean_radiance_is_that_of_another_path_tracer) {
  World world;
  Room room;
  room.add(world, quad({0, 1, 2}, {1, 0, 0}, {0, 0, 1}), 0.7);
  room.add(world, quad({0, -1, 2}, {1, 0, 0}, {0, 0, 1}), 0.7);
  room.add(world, quad({0, 0, 3}, {1, 0, 0}, {0, 1, 0}), 0.7);
  room.add(world, quad({-1, 0, 2}, {0, 1, 0}, {0, 0, 1}), 0.2);
  room.add(world, quad({1, 0, 2}, {0, 1, 0}, {0, 0, 1}), 0.45);
  room.add(world, box({0.25, 0.25, 0.25}, {0.4, 0.74, 1.7}), 0.6);
  room.add(world, box({0.25, 0.55, 0.25}, {-0.35, 0.44, 2.3}), 0.6);
  room.add(world, quad({0, -0.7, 2}, {0.3, 0, 0}, {0, 0, 0.3}), 0.3, 5);
  constexpr uint32_t size = 16, bounces = 5;
  constexpr double focal_px = 12;
  const Pixels image = world.radiance(view_at({0, 0, -0.5}, size, size, focal_px), 1024, bounces);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  constexpr int paths = 800;
  double expected[2] = {}, seen[2] = {};  // upper and lower half
  for (uint32_t r = 0; r < size; ++r)
    for (uint32_t c = 0; c < size; ++c) {
      double sum = 0;
      for (int i = 0; i < paths; ++i) {
        const double x = c + uniform(random) - (size - 1) / 2.0, y = r + uniform(random) - (size - 1) / 2.0;
        sum += room.radiance({0, 0, -0.5}, glm::normalize(Vec3(x / focal_px, y / focal_px, 1)), bounces);
      }
      expected[2 * r / size] += sum / paths;
      seen[2 * r / size] += double(image.at(0, r, c));
    }
  for (int half : {0, 1}) EXPECT_NEAR(seen[half] / expected[half], 1, 0.015) << half;
}

}  // namespace
}  // namespace laws
