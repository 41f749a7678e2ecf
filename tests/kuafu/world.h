// SPDX-License-Identifier: Apache-2.0
// A small world for law tests over kuafu's C API: objects release themselves, each call that fails fails the test.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/glm.hpp>
#include <map>
#include <numbers>
#include <optional>
#include <vector>

#include "kuafu/kuafu.h"
#include "support/skip.h"

namespace laws {

using Vec3 = glm::dvec3;
inline constexpr double pi = std::numbers::pi;

inline void ok(ks_status status) { ASSERT_EQ(status, KS_OK) << kuafu_last_error(); }

/// What a call answered that must not succeed: this status, and a message with this part.
inline void expect_refused(ks_status status, const std::string& part, ks_status expected = KS_ERROR_INVALID_ARGUMENT) {
  EXPECT_EQ(status, expected) << part;
  EXPECT_NE(std::string(kuafu_last_error()).find(part), std::string::npos) << kuafu_last_error();
}

/// One device per program: compiling shaders once is what makes these tests quick.
inline kuafu_device shared_device(uint32_t worker_count = 0) {
  static std::map<uint32_t, kuafu_device> devices;
  kuafu_device& device = devices[worker_count];
  if (device == nullptr) {
    ks_device_desc desc = ks_device_desc_init();
    desc.worker_count = worker_count;
    EXPECT_EQ(kuafu_device_create(&desc, &device), KS_OK) << kuafu_last_error();
  }
  return device;
}

/// Why the shared device cannot have the tracer; empty when it can.
inline std::string why_not(uint32_t tracer) {
  ks_device_info info = ks_device_info_init();
  ok(kuafu_device_get_info(shared_device(), &info));
  if (tracer == KUAFU_TRACER_EMBREE && info.kind != KS_DEVICE_KIND_CPU)
    return "Embree needs a CPU device, this is " + std::string(info.name) + ": VK_DRIVER_FILES can name lavapipe's";
  if (tracer == KUAFU_TRACER_RT_PIPELINE && !(info.capabilities & KS_CAP_RAY_TRACING_PIPELINE))
    return std::string(info.driver) + " has no ray tracing pipelines; to run this on a lavapipe that has: " +
           "bash tests/support/rt_mesa.sh build/bin/kuafu_laws_tests";
  return "";
}

/// Rendered images of one output: value(view, row, column, channel).
struct Pixels {
  uint32_t views = 0, height = 0, width = 0, channels = 0;
  std::vector<float> values;
  [[nodiscard]] float at(uint32_t view, uint32_t row, uint32_t column, uint32_t channel = 0) const {
    return values[((size_t(view) * height + row) * width + column) * channels + channel];
  }
  [[nodiscard]] uint32_t id_at(uint32_t view, uint32_t row, uint32_t column) const {
    uint32_t id;
    std::memcpy(&id, &values[((size_t(view) * height + row) * width + column) * channels], sizeof id);
    return id;
  }
  [[nodiscard]] double mean() const {
    double sum = 0;
    for (const float v : values) sum += v;
    return sum / double(values.size());
  }
};

inline uint32_t channels_of(uint32_t output, uint32_t band_channels) {
  if (output == KUAFU_OUTPUT_NORMAL || output == KUAFU_OUTPUT_POSITION) return 3;
  if (output == KUAFU_OUTPUT_PROJECTOR_UV || output == KUAFU_OUTPUT_MOTION) return 2;
  if (output == KUAFU_OUTPUT_ALBEDO) return band_channels;
  return output >= KUAFU_OUTPUT_DEPTH || output == KUAFU_OUTPUT_SAMPLE_COUNT ? 1 : band_channels;
}

/// Looks along +z of the world from `position`, turned by `yaw` radians about y (towards +x).
inline kuafu_view_desc view_at(const Vec3& position, uint32_t width, uint32_t height, double focal_px, double yaw = 0) {
  kuafu_view_desc v = kuafu_view_desc_init();
  v.band = KUAFU_BAND_INFRARED;
  v.camera.width = width;
  v.camera.height = height;
  const double k[9] = {focal_px, 0, (width - 1) / 2.0, 0, focal_px, (height - 1) / 2.0, 0, 0, 1};
  std::memcpy(v.camera.k, k, sizeof k);
  const double c = std::cos(yaw), s = std::sin(yaw);
  const double pose[16] = {c, 0, s, position[0], 0, 1, 0, position[1], -s, 0, c, position[2], 0, 0, 0, 1};
  std::memcpy(v.camera.camera_to_world, pose, sizeof pose);
  return v;
}

inline kuafu_view_desc visible(kuafu_view_desc view) {
  view.band = KUAFU_BAND_VISIBLE;
  return view;
}

/// Sum of the differences of two images, over the sum of the first.
inline double relative_difference(const Pixels& a, const Pixels& b) {
  double difference = 0, sum = 0;
  for (size_t i = 0; i < a.values.size(); ++i) {
    difference += std::abs(double(a.values[i]) - double(b.values[i]));
    sum += std::abs(a.values[i]);
  }
  return difference / sum;
}

struct Shape {
  std::vector<float> positions, normals, uvs, uvs_1, colors;
  std::vector<uint32_t> indices;
};

/// Parallelogram around `centre` with half edges a and b; its front side is a x b.
inline void add_quad(Shape& shape, const Vec3& centre, const Vec3& a, const Vec3& b) {
  const auto base = uint32_t(shape.positions.size() / 3);
  for (const auto& [sa, sb] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}})
    for (int i = 0; i < 3; ++i) shape.positions.push_back(float(centre[i] + sa * a[i] + sb * b[i]));
  for (const uint32_t i : {0u, 1u, 2u, 0u, 2u, 3u}) shape.indices.push_back(base + i);
}

inline Shape quad(const Vec3& centre, const Vec3& a, const Vec3& b) {
  Shape shape;
  add_quad(shape, centre, a, b);
  return shape;
}

/// A wall at distance z, 2 m wide per metre of z, seen from the origin; uv (0, 0) is at its upper left, (1, 1) at its lower right.
inline Shape uv_wall(double z = 1) {
  const auto s = float(z);
  Shape shape;
  shape.positions = {-s, -s, s, s, -s, s, s, s, s, -s, s, s};
  shape.uvs = {0, 0, 1, 0, 1, 1, 0, 1};
  shape.indices = {0, 2, 1, 0, 3, 2};
  return shape;
}

/// Axis-aligned box, front sides outwards.
inline Shape box(const Vec3& half, const Vec3& centre = {0, 0, 0}) {
  Shape shape;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      Vec3 c = centre, a{}, b{};
      c[axis] += side * half[axis];
      a[(axis + 1) % 3] = half[(axis + 1) % 3];
      b[(axis + 2) % 3] = side * half[(axis + 2) % 3];
      add_quad(shape, c, a, b);
    }
  return shape;
}

/// Latitude-longitude sphere; with exact normals when `smooth`.
inline Shape sphere(double radius, int rings, bool smooth, const Vec3& centre = {0, 0, 0}) {
  Shape shape;
  const int columns = 2 * rings;
  for (int r = 0; r <= rings; ++r)
    for (int c = 0; c <= columns; ++c) {
      const double theta = pi * r / rings, phi = 2 * pi * c / columns;
      const double s = r % rings == 0 ? 0 : std::sin(theta), turn = c == columns ? 0 : phi;  // poles and seam meet exactly
      const Vec3 n{s * std::cos(turn), s * std::sin(turn), std::cos(theta)};
      for (int i = 0; i < 3; ++i) shape.positions.push_back(float(centre[i] + radius * n[i]));
      if (smooth)
        for (int i = 0; i < 3; ++i) shape.normals.push_back(float(n[i]));
    }
  for (int r = 0; r < rings; ++r)
    for (int c = 0; c < columns; ++c) {
      const auto i = uint32_t(r * (columns + 1) + c), down = i + uint32_t(columns) + 1;
      if (r > 0) shape.indices.insert(shape.indices.end(), {i, down, i + 1});
      if (r + 1 < rings) shape.indices.insert(shape.indices.end(), {i + 1, down, down + 1});
    }
  return shape;
}

/// Rigid or scaled placement: rotation about y by `yaw`, then translation.
inline std::array<double, 16> placed(const Vec3& position, double yaw = 0, double scale = 1) {
  const double c = std::cos(yaw) * scale, s = std::sin(yaw) * scale;
  return {c, 0, s, position[0], 0, scale, 0, position[1], -s, 0, c, position[2], 0, 0, 0, 1};
}

inline kuafu_material_desc lambert(float albedo) {
  kuafu_material_desc m = kuafu_material_desc_init();
  m.specular = 0;
  for (int i = 0; i < 3; ++i) m.base_color[i] = albedo;
  return m;
}

inline kuafu_material_desc emitter(float radiance) {
  kuafu_material_desc m = lambert(0);
  for (float& e : m.emission) e = radiance;
  m.ir_emission = radiance;
  return m;
}

inline kuafu_material_desc metal(float roughness) {
  kuafu_material_desc m = kuafu_material_desc_init();
  m.metallic = 1;
  m.roughness = roughness;
  return m;
}

inline kuafu_material_desc glass(float ior) {
  kuafu_material_desc m = kuafu_material_desc_init();
  m.roughness = 0;
  m.transmission = 1;
  m.ior = ior;
  return m;
}

/// A texture of bytes or floats, which must outlive it.
template <class Texel>
kuafu_texture_desc texture_of(const std::vector<Texel>& texels, uint32_t width, uint32_t channels = 1) {
  kuafu_texture_desc t = kuafu_texture_desc_init();
  t.texels = texels.data();
  t.width = width;
  t.height = uint32_t(texels.size()) / width / channels;
  t.channels = channels;
  t.format = sizeof(Texel) == 1 ? KS_FORMAT_U8 : KS_FORMAT_F32;
  return t;
}

/// Every seventh texel shines.
inline std::vector<float> dotted(size_t texels) {
  std::vector<float> pattern(texels, 0.0f);
  for (size_t i = 0; i < texels; i += 7) pattern[i] = 1;
  return pattern;
}

/// Of infrared light alone.
inline kuafu_light_desc light_of(uint32_t kind, float ir_intensity, double radius_m = 0) {
  kuafu_light_desc light = kuafu_light_desc_init(kind);
  light.ir_intensity = ir_intensity;
  light.radius_m = radius_m;
  return light;
}

inline kuafu_light_desc rectangle_light(float ir_intensity, double width_m, double height_m) {
  kuafu_light_desc light = light_of(KUAFU_LIGHT_RECTANGLE, ir_intensity);
  light.size_m[0] = width_m, light.size_m[1] = height_m;
  return light;
}

/// The one name of each kind of stages: those of Embree run on the host.
inline const auto stages_name = [](const testing::TestParamInfo<uint32_t>& info) {
  return info.param == KUAFU_TRACER_EMBREE ? "host" : "device";
};

/// Every way of sampling lights gives the same mean.
template <class F>
void expect_samplings_agree(const F& mean, double tolerance, double tolerance_of_lights = 0) {
  const double mis = mean(KUAFU_SAMPLING_MIS);
  EXPECT_NEAR(mean(KUAFU_SAMPLING_LIGHTS) / mis, 1, std::max(tolerance, tolerance_of_lights));
  EXPECT_NEAR(mean(KUAFU_SAMPLING_BSDF) / mis, 1, tolerance);
}

/// The one renderer of a thread's worlds whose tracer compiles its shaders, which takes seconds.
inline kuafu_renderer& kept_renderer(uint32_t tracer, uint32_t worker_count) {
  thread_local std::map<std::pair<uint32_t, uint32_t>, kuafu_renderer> renderers;
  return renderers[{tracer, worker_count}];
}

/// A fixture's member whose tracer the device lacks skips the test; a test that makes one in its body asks SKIP_IF(why_not(...)) before.
class World {
 public:
  explicit World(uint32_t tracer = KUAFU_TRACER_AUTO, uint32_t worker_count = 0) : device_(shared_device(worker_count)), tracer_(tracer) {
    desc_ = kuafu_render_desc_init();
    desc_.ir_ambient_radiance = 0;
    if (const std::string why = why_not(tracer); !why.empty()) {
      ks_test::skip(why);
      return;
    }
    ok(kuafu_scene_create(device_, &scene_));
    kuafu_renderer& renderer = compiles(tracer) ? kept_renderer(tracer, worker_count) : renderer_;
    if (renderer == nullptr) {
      const kuafu_renderer_desc desc{ks_header_make(KUAFU_TYPE_RENDERER_DESC, sizeof desc), tracer, 0};
      ok(kuafu_renderer_create(device_, &desc, &renderer));
    }
    renderer_ = renderer;
  }
  ~World() {
    if (!compiles(tracer_)) kuafu_renderer_release(renderer_);
    kuafu_scene_release(scene_);
  }
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  uint32_t add(const Shape& shape, const kuafu_material_desc& material, const std::array<double, 16>& pose = placed({0, 0, 0}),
               uint32_t environment = KUAFU_ALL_ENVIRONMENTS, uint32_t semantic_id = 0) {
    kuafu_mesh_desc mesh{ks_header_make(KUAFU_TYPE_MESH_DESC, sizeof mesh)};
    mesh.positions = shape.positions.data();
    mesh.normals = shape.normals.empty() ? nullptr : shape.normals.data();
    mesh.uvs = shape.uvs.empty() ? nullptr : shape.uvs.data();
    mesh.uvs_1 = shape.uvs_1.empty() ? nullptr : shape.uvs_1.data();
    mesh.colors = shape.colors.empty() ? nullptr : shape.colors.data();
    mesh.indices = shape.indices.data();
    mesh.vertex_count = uint32_t(shape.positions.size() / 3);
    mesh.triangle_count = uint32_t(shape.indices.size() / 3);
    uint32_t mesh_id = 0, material_id = 0, id = 0;
    ok(kuafu_scene_add_mesh(scene_, &mesh, &mesh_id));
    ok(kuafu_scene_add_material(scene_, &material, &material_id));
    kuafu_instance_desc instance{ks_header_make(KUAFU_TYPE_INSTANCE_DESC, sizeof instance)};
    instance.mesh = mesh_id;
    instance.environment = environment;
    instance.semantic_id = semantic_id;
    instance.materials = &material_id;
    instance.material_count = 1;
    std::memcpy(instance.local_to_world, pose.data(), sizeof instance.local_to_world);
    ok(kuafu_scene_add_instance(scene_, &instance, &id));
    return id;
  }

  uint32_t add_texture(const kuafu_texture_desc& texture) {
    uint32_t id = 0;
    ok(kuafu_scene_add_texture(scene_, &texture, &id));
    return id;
  }

  kuafu_light_desc projector(const std::vector<float>& pattern, uint32_t width, uint32_t height, double focal_px, float intensity) {
    kuafu_light_desc light = light_of(KUAFU_LIGHT_PROJECTOR, intensity);
    light.texture = add_texture(texture_of(pattern, width));
    const double k[9] = {focal_px, 0, (width - 1) / 2.0, 0, focal_px, (height - 1) / 2.0, 0, 0, 1};
    std::memcpy(light.k, k, sizeof k);
    return light;
  }
  uint32_t add_projector(const std::vector<float>& pattern, uint32_t width, uint32_t height, double focal_px, float intensity,
                         const std::array<double, 16>& pose = placed({0, 0, 0})) {
    return add_light(projector(pattern, width, height, focal_px, intensity), pose);
  }

  uint32_t add_point(const Vec3& position, float intensity, uint32_t environment = KUAFU_ALL_ENVIRONMENTS) {
    kuafu_light_desc light = light_of(KUAFU_LIGHT_POINT, intensity);
    light.environment = environment;
    return add_light(light, placed(position));
  }

  uint32_t add_light(kuafu_light_desc light, const std::array<double, 16>& pose) {
    std::memcpy(light.light_to_world, pose.data(), sizeof light.light_to_world);
    uint32_t id = 0;
    ok(kuafu_scene_add_light(scene_, &light, &id));
    return id;
  }

  void set_environment(float radiance, uint32_t light_group = 0) {
    kuafu_environment_desc e = kuafu_environment_desc_init();
    e.light_group = light_group;
    for (float& r : e.radiance) r = radiance;
    e.ir_radiance = radiance;
    ok(kuafu_scene_set_environment(scene_, &e));
  }

  /// All images of all views; samples, bounces and seed are those of `desc()`.
  std::map<uint32_t, Pixels> render(const std::vector<kuafu_view_desc>& views, const std::vector<uint32_t>& outputs) {
    std::map<uint32_t, Pixels> images;
    ok(try_render(views, outputs, images));
    return images;
  }
  Pixels image(const kuafu_view_desc& view, uint32_t output) { return render({view}, {output})[output]; }
  /// What a render answers that may fail.
  ks_status status_of(const kuafu_view_desc& view, uint32_t output = KUAFU_OUTPUT_RADIANCE) {
    std::map<uint32_t, Pixels> images;
    return try_render({view}, {output}, images);
  }
  ks_status try_render(const std::vector<kuafu_view_desc>& views, const std::vector<uint32_t>& outputs,
                       std::map<uint32_t, Pixels>& images) {
    std::vector<kuafu_output_desc> descs;
    std::vector<kuafu_buffer> buffers;
    const uint32_t band_channels = views[0].band == KUAFU_BAND_INFRARED ? 1 : 3;
    for (const uint32_t output : outputs) {
      const bool id = (output >= KUAFU_OUTPUT_INSTANCE_ID && output <= KUAFU_OUTPUT_SEMANTIC_ID) || output == KUAFU_OUTPUT_SAMPLE_COUNT;
      Pixels& p = images[output];
      p.views = uint32_t(views.size());
      p.height = views[0].camera.height;
      p.width = views[0].camera.width;
      p.channels = channels_of(output, band_channels);
      p.values.resize(size_t(p.views) * p.height * p.width * p.channels);
      const ks_buffer_create_desc create = ks_buffer_create_desc_init(p.values.size() * 4, KS_BUFFER_HOST_VISIBLE);
      ok(kuafu_buffer_create(device_, &create, &buffers.emplace_back()));
      const uint64_t shape[4] = {p.views, p.height, p.width, p.channels};
      descs.push_back(kuafu_output_desc_init(output, buffers.back(), ks_image_desc_packed(id ? KS_FORMAT_U32 : KS_FORMAT_F32, 4, shape)));
    }
    desc_.views = views.data();
    desc_.view_count = uint32_t(views.size());
    desc_.outputs = descs.data();
    desc_.output_count = uint32_t(descs.size());
    const ks_status status = kuafu_renderer_render(renderer_, scene_, &desc_);
    for (size_t i = 0; i < buffers.size(); ++i) {
      Pixels& p = images[outputs[i]];
      if (status == KS_OK) ok(kuafu_buffer_read(buffers[i], 0, p.values.data(), p.values.size() * 4));
      kuafu_buffer_release(buffers[i]);
    }
    return status;
  }
  /// samples of a pixel, bounces of a path: of all images from now on.
  Pixels radiance(const kuafu_view_desc& view, std::optional<uint32_t> samples = {}, std::optional<uint32_t> bounces = {}) {
    desc_.samples_per_pixel = samples.value_or(desc_.samples_per_pixel), desc_.max_bounces = bounces.value_or(desc_.max_bounces);
    return image(view, KUAFU_OUTPUT_RADIANCE);
  }

  /// The same for all kinds of images.
  void take(uint32_t samples, uint32_t bounces) { desc_.samples_per_pixel = samples, desc_.max_bounces = bounces; }
  kuafu_render_desc& desc() { return desc_; }
  [[nodiscard]] kuafu_scene scene() const { return scene_; }
  [[nodiscard]] kuafu_renderer renderer() const { return renderer_; }

 private:
  static bool compiles(uint32_t tracer) { return tracer == KUAFU_TRACER_COMPUTE || tracer == KUAFU_TRACER_RT_PIPELINE; }

  kuafu_device device_;
  uint32_t tracer_;
  kuafu_scene scene_ = nullptr;
  kuafu_renderer renderer_ = nullptr;
  kuafu_render_desc desc_{};
};

}  // namespace laws
