// SPDX-License-Identifier: Apache-2.0
#include "accel/embree_motion.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "device/error.h"

namespace kuafu {
namespace {

constexpr double radians_per_step = 0.03;  // between steps Embree interpolates quaternions; its error here is below 1e-6 rad
constexpr double sag_m = 1e-6;             // by which an arc may leave its chord
constexpr double farthest_centre_m = 10;   // floats still resolve micrometres

/// A matrix as rotation times upper triangle (Gram and Schmidt), Embree's own decomposition.
struct Decomposed {
  glm::dmat3 rotation, triangle;
};

Decomposed decompose(const glm::dmat3& m) {
  glm::dmat3 q;
  q[0] = glm::normalize(m[0]);
  q[1] = glm::normalize(m[1] - q[0] * glm::dot(q[0], m[1]));
  q[2] = glm::cross(q[0], q[1]);
  return {q, glm::transpose(q) * m};
}

/// A point on the screw's axis where there is one near: it moves straight. Else the pivot, whose way is a helix.
glm::dvec3 centre_of(const Motion& motion) {
  const double w2 = glm::dot(motion.angular, motion.angular);
  if (w2 == 0.0) return motion.pivot;
  const glm::dvec3 to_axis = glm::cross(motion.angular, motion.linear) / w2;
  return glm::length(to_axis) <= farthest_centre_m ? motion.pivot + to_axis : motion.pivot;
}

uint32_t step_count(const Sweep& sweep, const glm::dvec3& centre) {
  const double seconds = sweep.span.until_s - sweep.span.from_s, angle = glm::length(sweep.motion.angular) * seconds;
  double steps = std::ceil(angle / radians_per_step);
  if (centre == sweep.motion.pivot) {  // chord error: way times angle over 8 n^2
    const double way = glm::length(sweep.motion.linear) * seconds;
    steps = std::max(steps, std::ceil(std::sqrt(way * angle / (8 * sag_m))));
  }
  constexpr double most = RTC_MAX_TIME_STEP_COUNT - 1;
  if (angle > most * radians_per_step)
    ks::fail(KS_ERROR_UNSUPPORTED,
             "an instance turns by %.3g rad while the shutter is open (%g s); KUAFU_TRACER_EMBREE follows at most %.3g: use "
             "KUAFU_TRACER_COMPUTE, "
             "or render shorter exposures",
             angle, seconds, most * radians_per_step);
  return uint32_t(std::clamp(steps, 1.0, most)) + 1;
}

}  // namespace

void set_motion(RTCGeometry geometry, const Placement& placement) {
  const Sweep& sweep = *placement.sweep;
  const glm::dvec3 centre = centre_of(sweep.motion);
  const Decomposed linear = decompose(glm::dmat3(placement.local_to_world));
  const glm::dvec3 shift = glm::transpose(linear.rotation) * (glm::dvec3(placement.local_to_world[3]) - centre);
  const uint32_t count = step_count(sweep, centre);
  rtcSetGeometryTimeStepCount(geometry, count);
  for (uint32_t i = 0; i < count; ++i) {
    const glm::dmat4 moved = sweep.motion.at(glm::mix(sweep.span.from_s, sweep.span.until_s, double(i) / (count - 1)));
    const glm::dquat turn = glm::quat_cast(glm::dmat3(moved) * linear.rotation);
    const glm::dvec3 place(moved * glm::dvec4(centre, 1.0));
    RTCQuaternionDecomposition q;
    rtcInitQuaternionDecomposition(&q);
    rtcQuaternionDecompositionSetQuaternion(&q, float(turn.w), float(turn.x), float(turn.y), float(turn.z));
    rtcQuaternionDecompositionSetScale(&q, float(linear.triangle[0][0]), float(linear.triangle[1][1]), float(linear.triangle[2][2]));
    rtcQuaternionDecompositionSetSkew(&q, float(linear.triangle[1][0]), float(linear.triangle[2][0]), float(linear.triangle[2][1]));
    rtcQuaternionDecompositionSetShift(&q, float(shift.x), float(shift.y), float(shift.z));
    rtcQuaternionDecompositionSetTranslation(&q, float(place.x), float(place.y), float(place.z));
    rtcSetGeometryTransformQuaternion(geometry, i, &q);
  }
  rtcCommitGeometry(geometry);
}

}  // namespace kuafu
