// SPDX-License-Identifier: Apache-2.0
// Animated values between keyframes, and vertices that skins and morph targets move, against the formulas of the glTF 2.0 specification.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include "device/error.h"
#include "scene/rig.h"

namespace {

using namespace kuafu;
using Interpolation = Keyframes::Interpolation;

std::vector<double> at(const Keyframes& keyframes, double time_s) {
  std::vector<double> out(keyframes.width);
  value_at(keyframes, time_s, out);
  return out;
}

Keyframes numbers(Interpolation interpolation, std::vector<float> values) {
  return {.interpolation = interpolation, .width = 1, .times_s = {1.0f, 2.0f, 4.0f}, .values = std::move(values)};
}

TEST(Keyframes, HoldStillBeforeTheFirstAndAfterTheLast) {
  for (const Interpolation interpolation : {Interpolation::linear, Interpolation::step}) {
    const Keyframes k = numbers(interpolation, {3, 5, 11});
    EXPECT_EQ(at(k, -7.0)[0], 3.0);
    EXPECT_EQ(at(k, 1.0)[0], 3.0);
    EXPECT_EQ(at(k, 4.0)[0], 11.0);
    EXPECT_EQ(at(k, 1e9)[0], 11.0);
  }
}

TEST(Keyframes, StepAndLinearAreAsTheirNamesSay) {
  EXPECT_EQ(at(numbers(Interpolation::step, {3, 5, 11}), 1.999)[0], 3.0);
  EXPECT_EQ(at(numbers(Interpolation::step, {3, 5, 11}), 2.0)[0], 5.0);
  EXPECT_DOUBLE_EQ(at(numbers(Interpolation::linear, {3, 5, 11}), 1.25)[0], 3.5);
  EXPECT_DOUBLE_EQ(at(numbers(Interpolation::linear, {3, 5, 11}), 3.0)[0], 8.0);
}

TEST(Keyframes, ACubicSplineIsTheCubicThatItsTangentsAreOf) {
  // Hermite's form reproduces every cubic: f(t) = 2 - t + 3 t^2 - t^3 / 2 with f' at the keyframes.
  const auto f = [](double t) { return 2 - t + 3 * t * t - 0.5 * t * t * t; };
  const auto slope = [](double t) { return -1 + 6 * t - 1.5 * t * t; };
  std::vector<float> values;
  for (const double t : {1.0, 2.0, 4.0})
    for (const double v : {slope(t), f(t), slope(t)}) values.push_back(static_cast<float>(v));
  const Keyframes k = numbers(Interpolation::cubic_spline, values);
  for (double t = 1.0; t <= 4.0; t += 0.125) EXPECT_NEAR(at(k, t)[0], f(t), 1e-6) << t;
  EXPECT_EQ(at(k, 0.0)[0], f(1.0));
  EXPECT_EQ(at(k, 9.0)[0], f(4.0));
}

Keyframes turn(Interpolation interpolation, double degrees, float sign) {
  const double half = glm::radians(degrees) / 2;
  Keyframes k{.interpolation = interpolation, .quaternion = true, .width = 4, .times_s = {0.0f, 1.0f}, .values = {0, 0, 0, 1}};
  for (const double v : {0.0, 0.0, std::sin(half), std::cos(half)}) k.values.push_back(sign * static_cast<float>(v));
  return k;
}

TEST(Keyframes, RotationsTurnAtConstantSpeedOnTheShorterWay) {
  for (const double degrees : {1e-5, 30.0, 120.0, 179.0})
    for (const float sign : {1.0f, -1.0f})  // q and -q are one rotation
      for (const double t : {0.25, 0.5, 0.9}) {
        const std::vector<double> q = at(turn(Interpolation::linear, degrees, sign), t);
        EXPECT_NEAR(2 * std::atan2(q[2], q[3]), glm::radians(degrees * t), 1e-6) << degrees << " at " << t;
        EXPECT_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1.0, 1e-12);
      }
}

TEST(Keyframes, RotationsOfASplineHaveUnitLength) {
  Keyframes k = turn(Interpolation::linear, 90, 1);
  const std::vector<float> ends = k.values;
  k.interpolation = Interpolation::cubic_spline;
  k.values.assign(24, 0.0f);
  for (size_t i = 0; i < 4; ++i) k.values[4 + i] = ends[i], k.values[16 + i] = ends[4 + i];
  const std::vector<double> q = at(k, 0.5);  // without tangents half-way is the mean, which is the half angle
  EXPECT_NEAR(2 * std::atan2(q[2], q[3]), glm::radians(45.0), 1e-6);
  EXPECT_NEAR(std::hypot(q[2], q[3]), 1.0, 1e-12);
}

/// Two joints, the second a child of the first, and a mesh whose vertices hang on both.
Rig arm() {
  Rig rig;
  rig.nodes = {RigNode{.rest = {.translation = {1, 0, 0}}}, RigNode{.parent = 0, .rest = {.translation = {0, 2, 0}}},
               RigNode{.rest = {.weights = {0.0f, 0.0f}}}};
  rig.skins = {{.joints = {0, 1}, .inverse_binds = {}}};
  const RigPose bind = rest_pose(rig);
  for (const uint32_t joint : rig.skins[0].joints) rig.skins[0].inverse_binds.emplace_back(glm::inverse(bind.node_to_root[joint]));
  RigMesh mesh{.mesh = 0, .node = 2, .skin = 0};
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  SkinWeights weights;
  mesh.targets.resize(2);
  for (int i = 0; i < 50; ++i) {
    const auto point = [&] { return glm::vec3(unit(random), unit(random), unit(random)); };
    mesh.positions.push_back(point());
    mesh.normals.push_back(glm::normalize(point()));
    const float share = unit(random);
    weights.joints.emplace_back(0, 1, 0, 0);
    weights.weights.emplace_back(share, 1.0f - share, 0.0f, 0.0f);
    mesh.targets[0].positions.push_back(point());
    mesh.targets[1].positions.push_back(point());
    mesh.targets[1].normals.push_back(0.2f * point());
  }
  mesh.skin_weights = {weights};
  rig.meshes = {mesh};
  Keyframes swing = turn(Interpolation::linear, 90, 1), grow{.width = 3, .times_s = {0, 1}, .values = {1, 1, 1, 1, 3, 0.5f}},
            morph{.width = 2, .times_s = {0, 1}, .values = {0, 0, 0.5f, -0.25f}};
  using Property = RigChannel::Property;
  rig.animations = {{.name = "swing", .channels = {{.node = 0, .property = Property::rotation, .keyframes = swing}}},
                    {.name = "all",
                     .channels = {{.node = 0, .property = Property::rotation, .keyframes = turn(Interpolation::linear, 40, 1)},
                                  {.node = 1, .property = Property::scale, .keyframes = grow},
                                  {.node = 2, .property = Property::weights, .keyframes = morph}}}};
  return rig;
}

TEST(Skin, InItsBindPoseNothingMoves) {
  const Rig rig = arm();
  const Vertices v = deformed(rig, rig.meshes[0], rest_pose(rig));
  for (size_t i = 0; i < v.positions.size(); ++i) {
    EXPECT_LT(glm::length(v.positions[i] - rig.meshes[0].positions[i]), 1e-6f);
    EXPECT_LT(glm::length(v.normals[i] - rig.meshes[0].normals[i]), 1e-6f);
  }
}

TEST(Skin, AVertexIsTheBlendOfTheJointsMatrices) {
  // Section 3.7.3.3: jointMatrix(j) = globalTransform(j) * inverseBindMatrix(j); vertex: sum w_j jointMatrix(j) (position + targets).
  const Rig rig = arm();
  const RigMesh& mesh = rig.meshes[0];
  const double t = 0.6;
  const glm::dmat4 turned = glm::rotate(glm::translate(glm::dmat4(1), {1, 0, 0}), glm::radians(90.0) * t, {0, 0, 1}),
                   child = glm::scale(glm::translate(turned, {0, 2, 0}), {1, 1 + 2 * t, 1 - 0.5 * t}),
                   bind_0 = glm::translate(glm::dmat4(1), {1, 0, 0}), bind_1 = glm::translate(bind_0, {0, 2, 0});
  const Vertices v = deformed(rig, mesh, pose_at(rig, none, t));  // "swing" is before "all" and turns the first joint
  for (size_t i = 0; i < v.positions.size(); ++i) {
    const glm::dvec4 w(mesh.skin_weights[0].weights[i]);
    const glm::dmat4 blend = w[0] * turned * glm::inverse(bind_0) + w[1] * child * glm::inverse(bind_1);
    const glm::dvec3 p(mesh.positions[i] + float(0.5 * t) * mesh.targets[0].positions[i] - float(0.25 * t) * mesh.targets[1].positions[i]),
        n(mesh.normals[i] - float(0.25 * t) * mesh.targets[1].normals[i]);
    EXPECT_LT(glm::length(glm::dvec3(v.positions[i]) - glm::dvec3(blend * glm::dvec4(p, 1))), 2e-6) << i;
    EXPECT_LT(glm::length(glm::dvec3(v.normals[i]) - glm::normalize(glm::transpose(glm::inverse(glm::dmat3(blend))) * n)), 2e-5) << i;
  }
}

TEST(Skin, NormalsStayOnTheirSideOfAMirroredMesh) {
  Rig rig = arm();
  rig.nodes[0].rest.scale = {-1, 1, 1};
  const RigMesh& mesh = rig.meshes[0];
  const Vertices v = deformed(rig, mesh, rest_pose(rig));
  for (size_t i = 0; i < v.normals.size(); ++i) EXPECT_LT(glm::length(v.normals[i] - mesh.normals[i] * glm::vec3(-1, 1, 1)), 1e-5f);
}

TEST(Skin, TangentsKeepToTheSurfaceAndToTheirBitangents) {
  Rig rig = arm();
  RigMesh& mesh = rig.meshes[0];
  for (const glm::vec3& n : mesh.normals) mesh.tangents.emplace_back(glm::normalize(glm::cross(n, {0.3f, -0.8f, 0.5f})), 1.0f);
  mesh.targets.clear();
  for (const bool mirrored : {false, true}) {
    rig.nodes[0].rest.scale = {mirrored ? -1 : 1, 1, 1};
    rig.nodes[1].rest.scale = {1, 3, 0.5};
    const Vertices v = deformed(rig, mesh, rest_pose(rig));
    ASSERT_EQ(v.tangents.size(), v.normals.size());
    for (size_t i = 0; i < v.tangents.size(); ++i) {
      EXPECT_NEAR(glm::length(glm::vec3(v.tangents[i])), 1.0f, 1e-5f);
      EXPECT_NEAR(glm::dot(glm::vec3(v.tangents[i]), v.normals[i]), 0.0f, 1e-5f);
      // Both joints mirror x alone, so the bitangent is mirrored too, but for what the scale adds.
      EXPECT_EQ(v.tangents[i].w, mirrored ? -1.0f : 1.0f);
    }
  }
}

TEST(Rig, OneAnimationLeavesTheOthersAtRest) {
  const Rig rig = arm();
  const RigPose swing = pose_at(rig, 0, 1.0), all = pose_at(rig, 1, 1.0);
  EXPECT_EQ(swing.nodes[1].scale, glm::dvec3(1));
  EXPECT_EQ(swing.nodes[2].weights, (std::vector<float>{0, 0}));
  EXPECT_EQ(all.nodes[2].weights, (std::vector<float>{0.5f, -0.25f}));
  EXPECT_NEAR(2 * std::atan2(all.nodes[0].rotation.z, all.nodes[0].rotation.w), glm::radians(40.0), 1e-6);
  EXPECT_EQ(rig.animations[1].duration_s(), 1.0);
}

TEST(Rig, WhatDoesNotFitIsRefused) {
  const auto refused = [](auto&& spoil) {
    Rig rig = arm();
    spoil(rig);
    EXPECT_THROW(check(rig), ks::Error);
  };
  EXPECT_NO_THROW(check(arm()));
  refused([](Rig& r) { r.nodes[0].parent = 0; });
  refused([](Rig& r) { r.nodes[1].rest.scale.y = NAN; });
  refused([](Rig& r) { r.nodes[1].rest.rotation = {0, 0, 0, 0}; });
  refused([](Rig& r) { r.skins[0].joints[1] = 3; });
  refused([](Rig& r) { r.skins[0].inverse_binds.pop_back(); });
  refused([](Rig& r) { r.meshes[0].skin_weights[0].joints[7].w = 2; });
  refused([](Rig& r) { r.meshes[0].targets[0].positions.pop_back(); });
  refused([](Rig& r) { r.meshes[0].node = 1; });  // which has no weights
  refused([](Rig& r) { r.animations[0].channels.clear(); });
  refused([](Rig& r) { r.animations[0].channels[0].node = 9; });
  refused([](Rig& r) { r.animations[0].channels[0].keyframes.times_s = {1, 1}; });
  refused([](Rig& r) { r.animations[0].channels[0].keyframes.values.pop_back(); });
  refused([](Rig& r) { r.members = {{.id = 0, .node = 3}}; });
}

}  // namespace
