// SPDX-License-Identifier: Apache-2.0
#include "scene/validate.h"

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstring>

#include "device/error.h"
#include "scene/finite.h"

namespace kuafu {
namespace {

constexpr float unit_tolerance = 1e-2f;      // of a normal's length; float32 files round to far less
constexpr double rotation_tolerance = 1e-4;  // of R^T R - 1
constexpr uint32_t max_slots = 1u << 16;     // of one mesh
constexpr uint32_t max_texture_side = 1u << 15;
constexpr double most_speed = 1e6;    // m/s, rad/s
constexpr double most_bound_m = 1e9;  // of a medium: beyond it, float32 makes nothing of a ray's way through it

void check_range(const char* what, const std::string& name, const char* field, double value, double low, double high) {
  if (std::isfinite(value) && value >= low && value <= high) return;
  if (std::isinf(high))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s '%s': %s is %g, must be finite and >= %g", what, name.c_str(), field, value, low);
  ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s '%s': %s is %g, must be in [%g, %g]", what, name.c_str(), field, value, low, high);
}

void check_pinhole(const char* what, const std::string& name, const glm::dmat3& k) {
  if (!all_finite(k)) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s '%s': K has a value that is not finite", what, name.c_str());
  if (k[0][0] <= 0.0 || k[1][1] <= 0.0)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s '%s': focal lengths of K are %g and %g pixels, must be > 0", what, name.c_str(), k[0][0],
             k[1][1]);
  if (k[0][1] != 0.0 || k[0][2] != 0.0 || k[1][2] != 0.0 || k[2][2] != 1.0)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s '%s': K is not [fx s cx; 0 fy cy; 0 0 1] (row-major)", what, name.c_str());
}

void check_counts(const Mesh& mesh) {
  const size_t count = mesh.positions.size();
  const char* name = mesh.name.c_str();
  if (!mesh.normals.empty() && mesh.normals.size() != count)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %zu normals for %zu vertices", name, mesh.normals.size(), count);
  if (!mesh.uvs.empty() && mesh.uvs.size() != count)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %zu uvs for %zu vertices", name, mesh.uvs.size(), count);
  if (!mesh.uvs_1.empty() && mesh.uvs_1.size() != count)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %zu uvs_1 for %zu vertices", name, mesh.uvs_1.size(), count);
  if (!mesh.colors.empty() && mesh.colors.size() != count)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %zu colors for %zu vertices", name, mesh.colors.size(), count);
  if (!mesh.tangents.empty() && (mesh.tangents.size() != count || mesh.normals.empty()))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %zu tangents for %zu vertices with %zu normals", name, mesh.tangents.size(), count,
             mesh.normals.size());
}

}  // namespace

void check_vertices(const std::string& mesh, const std::vector<glm::vec3>& positions, const std::vector<glm::vec3>& normals) {
  const char* name = mesh.c_str();
  for (size_t i = 0; i < positions.size(); ++i)
    if (!all_finite(positions[i])) ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': position %zu is not finite", name, i);
  for (size_t i = 0; i < normals.size(); ++i) {
    const float length = glm::length(normals[i]);
    if (!(std::abs(length - 1.0f) <= unit_tolerance))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': normal %zu has length %g, must be 1", name, i, static_cast<double>(length));
  }
}

void check(const Mesh& mesh) {
  const char* name = mesh.name.c_str();
  if (mesh.positions.empty()) ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': no vertices", name);
  if (mesh.indices.empty()) ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': no triangles", name);
  if (mesh.positions.size() > 0xfffffffeu || mesh.indices.size() > 0xfffffffeu)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %zu vertices and %zu triangles, at most 2^32 - 2 each", name, mesh.positions.size(),
             mesh.indices.size());
  check_counts(mesh);
  check_vertices(mesh.name, mesh.positions, mesh.normals);
  for (const std::vector<glm::vec2>* uvs : {&mesh.uvs, &mesh.uvs_1})
    for (size_t i = 0; i < uvs->size(); ++i)
      if (!all_finite((*uvs)[i]))
        ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %s %zu is not finite", name, uvs == &mesh.uvs ? "uv" : "uv_1", i);
  for (size_t i = 0; i < mesh.tangents.size(); ++i)
    if (!all_finite(mesh.tangents[i])) ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': tangent %zu is not finite", name, i);
  for (size_t i = 0; i < mesh.colors.size(); ++i)
    if (!all_finite(mesh.colors[i]) || glm::any(glm::lessThan(mesh.colors[i], glm::vec4(0.0f))))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': color %zu is (%g, %g, %g, %g), must be finite and >= 0", name, i, mesh.colors[i].r,
               mesh.colors[i].g, mesh.colors[i].b, mesh.colors[i].a);
  for (size_t i = 0; i < mesh.indices.size(); ++i)
    for (int k = 0; k < 3; ++k)
      if (mesh.indices[i][k] >= mesh.positions.size())
        ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': triangle %zu uses vertex %u, but there are %zu vertices", name, i,
                 mesh.indices[i][k], mesh.positions.size());
  if (!mesh.slots.empty() && mesh.slots.size() != mesh.indices.size())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %zu slots for %zu triangles", name, mesh.slots.size(), mesh.indices.size());
  for (size_t i = 0; i < mesh.slots.size(); ++i)
    if (mesh.slots[i] >= max_slots)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': triangle %zu has material slot %u, must be < %u", name, i, mesh.slots[i], max_slots);
}

uint64_t texel_bytes(const Texture& texture) {
  const char* name = texture.name.c_str();
  if (texture.width == 0 || texture.height == 0 || texture.width > max_texture_side || texture.height > max_texture_side)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "texture '%s': size is %ux%u, each side must be in [1, %u]", name, texture.width, texture.height,
             max_texture_side);
  if (texture.channels < 1 || texture.channels > 4)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "texture '%s': %u channels, must be 1 to 4", name, texture.channels);
  const uint64_t channel_bytes = texture.format == Texture::Format::u8 ? 1 : texture.format == Texture::Format::u16 ? 2 : 4;
  return uint64_t{texture.width} * texture.height * texture.channels * channel_bytes;
}

void check(const Texture& texture) {
  const char* name = texture.name.c_str();
  const uint64_t bytes = texel_bytes(texture);
  if (texture.texels.size() != bytes)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "texture '%s': %zu bytes, but its size and format make %" PRIu64, name, texture.texels.size(),
             bytes);
  check_fields(texture, "texture '" + texture.name + "': ");
  if (texture.format != Texture::Format::f32) return;
  for (size_t i = 0; i < bytes; i += 4) {
    float value;
    std::memcpy(&value, texture.texels.data() + i, 4);
    if (!std::isfinite(value)) ks::fail(KS_ERROR_INVALID_ARGUMENT, "texture '%s': value %zu is not finite", name, i / 4);
  }
}

void check(const Material& material) { check_fields(material, "material '" + material.name + "': "); }

namespace {

void check_shape(const Light& light) {
  using Kind = Light::Kind;
  const auto positive = [&](const char* field, double value) {
    if (!(value > 0.0 && std::isfinite(value)))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "light '%s': %s is %g, must be finite and > 0", light.name.c_str(), field, value);
  };
  const double right_angle = std::acos(0.0);
  if (light.kind == Kind::disk) positive("radius_m", light.radius_m);
  if (light.kind == Kind::rectangle || (light.kind == Kind::directional && light.texture != none))
    for (int i = 0; i < 2; ++i) positive("size_m", light.size_m[i]);
  if (light.kind == Kind::directional) check_range("light", light.name, "angle_rad", light.angle_rad, 0.0, right_angle);
  if (light.kind == Kind::point && light.radius_m > 0.0 && light.texture != none)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "light '%s': a point light with a radius takes no texture", light.name.c_str());
  if (light.kind != Kind::spot) return;
  if (!(light.inner_rad >= 0.0 && light.outer_rad > light.inner_rad && light.outer_rad <= right_angle))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "light '%s': inner_rad is %g and outer_rad %g, must be 0 <= inner < outer <= pi/2",
             light.name.c_str(), light.inner_rad, light.outer_rad);
}

void check_optics(const Camera& camera) {
  const char* name = camera.name.c_str();
  if (camera.lens.lens_radius_m > 0.0 && !(camera.lens.focus_m > 0.0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "camera '%s': focus_m is %g, a lens of radius %g m needs a distance > 0 (INFINITY is one)", name,
             camera.lens.focus_m, camera.lens.lens_radius_m);
}

void check_projector(const Light& light) {
  check_pinhole("light", light.name, light.k);
  if (!light.dots.dots.empty()) check(light.dots, light.name);
}

}  // namespace

void check_velocity(const char* what, const std::string& name, const Twist& velocity) {
  for (int i = 0; i < 3; ++i) {
    check_range(what, name, "linear_velocity", velocity.linear[i], -most_speed, most_speed);
    check_range(what, name, "angular_velocity", velocity.angular[i], -most_speed, most_speed);
  }
}

void check(const Light& light) {
  check_fields(light, "light '" + light.name + "': ");
  check_rigid(light.light_to_world, ("light '" + light.name + "': light_to_world").c_str());
  check_shape(light);
  if (light.on_until_s < light.on_from_s)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "light '%s': it is on from %g to %g s, must be in this order; both equal = always",
             light.name.c_str(), light.on_from_s, light.on_until_s);
  if (light.kind == Light::Kind::projector) return check_projector(light);
  if (!light.dots.dots.empty())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "light '%s': %zu dots, but only a projector takes dots", light.name.c_str(),
             light.dots.dots.size());
}

void check(const Environment& environment) {
  check_fields(environment, "environment: ");
  check_rigid(glm::dmat4(environment.map_to_world), "environment: map_to_world");
}

void check(const Medium& medium) {
  check_fields(medium, "medium: ");
  for (int i = 0; i < 3; ++i) {
    if (!(medium.bounds_min_m[i] < medium.bounds_max_m[i]))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "medium: bounds on axis %d are %g to %g, must grow", i, medium.bounds_min_m[i],
               medium.bounds_max_m[i]);
    for (const double bound : {medium.bounds_min_m[i], medium.bounds_max_m[i]})
      if (std::abs(bound) > most_bound_m && !std::isinf(bound))
        ks::fail(KS_ERROR_INVALID_ARGUMENT, "medium: a bound on axis %d is %g m, must be in [%g, %g], or infinite where there is none", i,
                 bound, -most_bound_m, most_bound_m);
  }
  if (!(std::abs(medium.phase_g) < 1.0f))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "medium: phase_g is %g, must be in (-1, 1)", double(medium.phase_g));
}

void check(const Camera& camera) {
  check_fields(camera, "camera '" + camera.name + "': ");
  check_pinhole("camera", camera.name, camera.k);
  check_rigid(camera.camera_to_world, ("camera '" + camera.name + "': camera_to_world").c_str());
  if (!(camera.near_m >= 0.0 && camera.far_m > camera.near_m))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "camera '%s': near_m is %g and far_m is %g, must be 0 <= near < far", camera.name.c_str(),
             camera.near_m, camera.far_m);
  check_optics(camera);
}

void check_undistortable(const Camera& camera) {
  if (!distorts(camera.lens.distortion)) return;
  const std::optional<Fold> fold = find_fold(camera.lens.distortion, camera.k, camera.width, camera.height);
  if (!fold) return;
  ks::fail(
      KS_ERROR_INVALID_ARGUMENT,
      "camera '%s': its distortion cannot be inverted over the image: towards pixel (%.1f, %.1f) it grows to radius %.4g (tangent of the "
      "angle "
      "from the axis, %.1f pixels) and folds back, but the pixel lies at %.4g: use coefficients fitted out to the image's corners, or a "
      "smaller image",
      camera.name.c_str(), fold->pixel.x, fold->pixel.y, fold->reached, fold->reached * camera.k[0][0], fold->needed);
}

void check_affine(const glm::dmat4& matrix, const char* what) {
  if (!all_finite(matrix)) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has a value that is not finite", what);
  if (matrix[0][3] != 0.0 || matrix[1][3] != 0.0 || matrix[2][3] != 0.0 || matrix[3][3] != 1.0)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has the last row %g %g %g %g, must be 0 0 0 1 (row-major)", what, matrix[0][3], matrix[1][3],
             matrix[2][3], matrix[3][3]);
  const glm::dmat3 linear(matrix);
  for (int c = 0; c < 3; ++c) {  // beyond these the rays in the mesh's own axes leave the range of floats
    const double scale = glm::length(linear[c]);
    if (!(scale >= 1e-9 && scale <= 1e9))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s scales axis %d by %g, must be 1e-9 to 1e9", what, c, scale);
  }
  if (!(glm::length(glm::dvec3(matrix[3])) <= 1e12))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s moves by %g m, must be at most 1e12", what, glm::length(glm::dvec3(matrix[3])));
  const double volume = glm::length(linear[0]) * glm::length(linear[1]) * glm::length(linear[2]);
  if (!(std::abs(glm::determinant(linear)) > 1e-12 * volume))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is not invertible (determinant %g)", what, glm::determinant(linear));
}

void check_rigid(const glm::dmat4& matrix, const char* what) {
  check_affine(matrix, what);
  const glm::dmat3 rotation(matrix);
  const glm::dmat3 residual = glm::transpose(rotation) * rotation - glm::dmat3(1.0);
  double worst = 0.0;
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r) worst = std::max(worst, std::abs(residual[c][r]));
  if (!(worst <= rotation_tolerance) || glm::determinant(rotation) < 0.0)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is not a rotation and translation (|R^T R - 1| is %g, determinant %g)", what, worst,
             glm::determinant(rotation));
}

}  // namespace kuafu
