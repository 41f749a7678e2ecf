// SPDX-License-Identifier: Apache-2.0
#include "plain_tracer.h"

#include <embree3/rtcore.h>
#include <xmmintrin.h>

#include <algorithm>
#include <atomic>
#include <thread>

namespace bench {
namespace {

constexpr int lanes = 8;
constexpr float pi = std::numbers::pi_v<float>;

struct V {
  float x, y, z;
};
V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
V operator*(float s, V a) { return {s * a.x, s * a.y, s * a.z}; }
float dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V normalized(V a) { return 1 / std::sqrt(dot(a, a)) * a; }
V row_times(const double* m, V v, float w) {
  const auto row = [&](int r) {
    return float(m[4 * r]) * v.x + float(m[4 * r + 1]) * v.y + float(m[4 * r + 2]) * v.z + w * float(m[4 * r + 3]);
  };
  return {row(0), row(1), row(2)};
}

/// PCG hash (Jarzynski and Olano 2020) as a stream per path.
struct Random {
  uint32_t state;
  float next() {
    state = state * 747796405u + 2891336453u;
    const uint32_t word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return float(((word >> 22u) ^ word) >> 8) * (1.0f / 16777216.0f);
  }
};

/// An orthonormal frame around n (Duff et al. 2017).
struct Frame {
  V t, b, n;
  explicit Frame(V normal) : n(normal) {
    const float s = std::copysign(1.0f, n.z), a = -1 / (s + n.z), c = n.x * n.y * a;
    t = {1 + s * n.x * n.x * a, s * c, -s * n.x};
    b = {c, s + n.y * n.y * a, -n.y};
  }
  [[nodiscard]] V to_world(V v) const { return v.x * t + v.y * b + v.z * n; }
};

struct Surface {
  float albedo, alpha;
};

struct Bsdf {
  float value, pdf;  // value times cosine
};

/// GGX with Smith's height-correlated term and Schlick's Fresnel over Lambert; half of the samples go each way.
Bsdf evaluate(const Surface& m, V n, V wo, V wi) {
  const float nl = dot(n, wi), nv = std::max(dot(n, wo), 1e-4f);
  if (nl <= 0) return {0, 0};
  const V h = normalized(wo + wi);
  const float nh = std::max(dot(n, h), 0.0f), vh = std::max(dot(wo, h), 1e-4f), a2 = m.alpha * m.alpha;
  const float k = nh * nh * (a2 - 1) + 1, d = a2 / (pi * k * k);
  const float g = 0.5f / (nl * std::sqrt(nv * nv * (1 - a2) + a2) + nv * std::sqrt(nl * nl * (1 - a2) + a2));
  const float c = 1 - vh, f = 0.04f + 0.96f * c * c * c * c * c;
  return {(m.albedo / pi * (1 - f) + d * g * f) * nl, 0.5f * nl / pi + 0.5f * d * nh / (4 * vh)};
}

V sample(const Surface& m, const Frame& frame, V wo, Random& random) {
  const float which = random.next(), u = random.next(), v = random.next(), phi = 2 * pi * v;
  if (which < 0.5f) {
    const float r = std::sqrt(u);
    return frame.to_world({r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(0.0f, 1 - u))});
  }
  const float a2 = m.alpha * m.alpha, cosine = std::sqrt((1 - u) / (1 + (a2 - 1) * u)),
              sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine));
  const V h = frame.to_world({sine * std::cos(phi), sine * std::sin(phi), cosine});
  return 2 * dot(wo, h) * h - wo;
}

struct Path {
  V origin, direction;
  float throughput, radiance;
  Random random;
  bool alive;
};

}  // namespace

struct PlainTracer::State {
  explicit State(const TableTop& t) : scene(t), device(rtcNewDevice(nullptr)), top(rtcNewScene(device)) {
    for (const Shape& shape : t.shapes) bottoms.push_back(bottom(shape));
    for (const Placed& p : t.instances) {
      RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(geometry, bottoms[p.shape]);
      float rows[12];
      for (int i = 0; i < 12; ++i) rows[i] = float(p.local_to_world[size_t(i)]);
      rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, rows);
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(top, geometry);
      rtcReleaseGeometry(geometry);
      const kuafu_material_desc& m = t.materials[p.material];
      surfaces.push_back({m.base_color[0], m.roughness * m.roughness});
    }
    rtcCommitScene(top);
    for (int i = 0; i < 9; ++i) light_k[i] = float(t.projector.k[i]);
  }
  ~State() {
    rtcReleaseScene(top);
    for (RTCScene b : bottoms) rtcReleaseScene(b);
    rtcReleaseDevice(device);
  }

  RTCScene bottom(const Shape& shape) const {
    RTCScene out = rtcNewScene(device);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    const auto copy = [&](RTCBufferType type, RTCFormat format, const void* data, size_t count) {
      std::memcpy(rtcSetNewGeometryBuffer(geometry, type, 0, format, 12, count), data, 12 * count);
    };
    copy(RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, shape.positions.data(), shape.positions.size() / 3);
    copy(RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, shape.indices.data(), shape.indices.size() / 3);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(out, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(out);
    return out;
  }

  /// The projector's radiant intensity towards a point; bilinear in its pattern.
  [[nodiscard]] float intensity(V to_point) const {
    const double* m = scene.projector.light_to_world;
    const auto column = [&](int c) { return float(m[c]) * to_point.x + float(m[4 + c]) * to_point.y + float(m[8 + c]) * to_point.z; };
    const float z = column(2);
    if (z <= 0) return 0;
    const float u = light_k[0] * column(0) / z + light_k[2], v = light_k[4] * column(1) / z + light_k[5];
    constexpr float last = float(pattern_size - 1);
    if (!(u >= 0 && v >= 0 && u < last && v < last)) return 0;
    const auto x = uint32_t(u), y = uint32_t(v);
    const float a = u - float(x), b = v - float(y);
    const uint8_t* p = &scene.pattern[y * pattern_size + x];
    const float top_row = float(p[0]) * (1 - a) + float(p[1]) * a, row = float(p[pattern_size]) * (1 - a) + float(p[pattern_size + 1]) * a;
    return scene.projector.ir_intensity * (top_row * (1 - b) + row * b) / 255.0f;
  }

  [[nodiscard]] V normal_at(const RTCRayHit8& packet, int lane) const {
    const Placed& p = scene.instances[packet.hit.instID[0][lane]];
    const Shape& shape = scene.shapes[p.shape];
    const uint32_t* i = &shape.indices[3 * size_t(packet.hit.primID[lane])];
    const auto n = [&](uint32_t k) {
      return V{shape.normals[3 * size_t(k)], shape.normals[3 * size_t(k) + 1], shape.normals[3 * size_t(k) + 2]};
    };
    const float u = packet.hit.u[lane], v = packet.hit.v[lane];
    const V local = (1 - u - v) * n(i[0]) + u * n(i[1]) + v * n(i[2]);
    return normalized(row_times(p.local_to_world.data(), local, 0));  // rotation and one scale: no inverse needed
  }

  /// One packet of paths from the camera to their ends; returns the rays traced.
  uint32_t trace(Path* paths, uint32_t depth) const {
    uint32_t rays = 0;
    for (uint32_t bounce = 0; bounce < depth; ++bounce) {
      alignas(32) int valid[lanes];
      RTCRayHit8 packet;
      for (int i = 0; i < lanes; ++i) {
        const Path& p = paths[i];
        valid[i] = p.alive ? -1 : 0;
        rays += p.alive;
        set_ray(packet.ray, i, p.origin, p.direction, std::numeric_limits<float>::infinity());
        packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      }
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      context.flags = bounce == 0 ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
      rtcIntersect8(valid, top, &context, &packet);
      rays += shade(paths, packet);
    }
    return rays;
  }

  static void set_ray(RTCRay8& r, int i, V origin, V direction, float t_far) {
    r.org_x[i] = origin.x, r.org_y[i] = origin.y, r.org_z[i] = origin.z;
    r.dir_x[i] = direction.x, r.dir_y[i] = direction.y, r.dir_z[i] = direction.z;
    r.tnear[i] = 0, r.tfar[i] = t_far, r.time[i] = 0, r.mask[i] = 0xffffffffu, r.id[i] = 0, r.flags[i] = 0;
  }

  /// Asks for the projector's light at each hit and samples the way on; returns the shadow rays traced.
  uint32_t shade(Path* paths, const RTCRayHit8& packet) const {
    alignas(32) int valid[lanes];
    RTCRay8 shadow;
    float light[lanes];
    uint32_t rays = 0;
    const double* pose = scene.projector.light_to_world;
    const V light_at{float(pose[3]), float(pose[7]), float(pose[11])};
    for (int i = 0; i < lanes; ++i) {
      Path& p = paths[i];
      valid[i] = 0;
      set_ray(shadow, i, {0, 0, 0}, {0, 0, 1}, 0);
      p.alive = p.alive && packet.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
      if (!p.alive) continue;
      const Surface& surface = surfaces[packet.hit.instID[0][i]];
      V n = normal_at(packet, i);
      if (dot(n, p.direction) > 0) n = -1.0f * n;
      const V wo = -1.0f * p.direction, at = p.origin + packet.ray.tfar[i] * p.direction + 1e-4f * n;
      const V to_light = light_at - at;
      const float distance = std::sqrt(dot(to_light, to_light));
      const V wi = 1 / distance * to_light;
      const float value = evaluate(surface, n, wo, wi).value * intensity(at - light_at) / (distance * distance);
      if (value > 0) {
        valid[i] = -1, ++rays;
        light[i] = p.throughput * value;
        set_ray(shadow, i, at, wi, distance * 0.9999f);
      }
      const Frame frame(n);
      const V next = sample(surface, frame, wo, p.random);
      const Bsdf f = evaluate(surface, n, wo, next);
      p.alive = f.pdf > 1e-6f;
      if (p.alive) p.throughput *= f.value / f.pdf;
      p.origin = at, p.direction = next;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded8(valid, top, &context, &shadow);
    for (int i = 0; i < lanes; ++i)
      if (valid[i] && shadow.tfar[i] >= 0) paths[i].radiance += light[i];
    return rays;
  }

  const TableTop& scene;
  RTCDevice device;
  RTCScene top;
  std::vector<RTCScene> bottoms;
  std::vector<Surface> surfaces;  // by instance
  float light_k[9];
};

PlainTracer::PlainTracer(const TableTop& scene) : state_(std::make_unique<State>(scene)) {}
PlainTracer::~PlainTracer() = default;

PlainTracer::Result PlainTracer::render(const std::vector<kuafu_camera_desc>& cameras, uint32_t samples, uint32_t depth,
                                        uint32_t threads) const {
  const uint32_t width = cameras[0].width, height = cameras[0].height, rows = uint32_t(cameras.size()) * height;
  Result result{std::vector<float>(size_t(rows) * width), 0};
  std::atomic<uint32_t> next_row = 0;
  std::atomic<uint64_t> rays = 0;
  const auto work = [&] {
    _mm_setcsr(_mm_getcsr() | 0x8040);  // flush denormals, as Embree asks
    uint64_t own_rays = 0;
    for (uint32_t row = next_row++; row < rows; row = next_row++) {
      const kuafu_camera_desc& camera = cameras[row / height];
      const float y = float(row % height);
      const V eye{float(camera.camera_to_world[3]), float(camera.camera_to_world[7]), float(camera.camera_to_world[11])};
      for (uint32_t x = 0; x < width; x += lanes)
        for (uint32_t s = 0; s < samples; ++s) {
          Path paths[lanes];
          for (uint32_t i = 0; i < lanes; ++i) {
            Path& p = paths[i];
            p = {eye, {}, 1, 0, {(row * width + x + i) * 9781u + s * 6271u + 1u}, x + i < width};
            const float px = float(x + i) + p.random.next() - 0.5f, py = y + p.random.next() - 0.5f;
            const V ray{(px - float(camera.k[2])) / float(camera.k[0]), (py - float(camera.k[5])) / float(camera.k[4]), 1};
            p.direction = normalized(row_times(camera.camera_to_world, ray, 0));
          }
          own_rays += state_->trace(paths, depth);
          for (uint32_t i = 0; i < lanes && x + i < width; ++i)
            result.image[size_t(row) * width + x + i] += paths[i].radiance / float(samples);
        }
    }
    rays += own_rays;
  };
  std::vector<std::thread> others;
  for (uint32_t t = 1; t < threads; ++t) others.emplace_back(work);
  work();
  for (std::thread& t : others) t.join();
  result.rays = double(rays);
  return result;
}

}  // namespace bench
