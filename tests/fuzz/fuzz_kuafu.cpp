// SPDX-License-Identifier: Apache-2.0
// Bytes as a sequence of calls of kuafu's C interface, with handles that are NULL, foreign or released, absurd sizes, and numbers that are
// none: each gives a status or its result. Pointers are right, and arrays are as long as they are said to be: C can check neither.
#include <algorithm>
#include <array>
#include <cstdlib>

#include "handles.h"
#include "kuafu/kuafu.h"

namespace {

constexpr uint64_t host_bytes = 1 << 16;
constexpr uint32_t vertices = 8, most_side = 8;

kuafu_device open_device() {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_CPU;
  desc.worker_count = 1;
  kuafu_device device = nullptr;
  if (kuafu_device_create(&desc, &device) != KS_OK) std::abort();
  return device;
}

int end_after_some_questions(void* left, float) { return --*static_cast<int*>(left) < 0; }

class Calls {
 public:
  Calls(kuafu_device device, const uint8_t* data, size_t size) : device_(device), bytes_(data, size) {}
  void run() {
    begin();
    for (int n = 0; n < 40 && !bytes_.empty(); ++n) call();
  }

 private:
  using Buffers = Handles<kuafu_buffer, kuafu_buffer_retain, kuafu_buffer_release>;
  using Scenes = Handles<kuafu_scene, kuafu_scene_retain, kuafu_scene_release>;
  using Renderers = Handles<kuafu_renderer, kuafu_renderer_retain, kuafu_renderer_release>;

  /// A triangle in front of a renderer, so that most sequences have something to break.
  void begin() {
    (void)kuafu_scene_create(device_, scenes_.out());
    scenes_.keep();
    (void)kuafu_renderer_create(device_, nullptr, renderers_.out());
    renderers_.keep();
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(most_side * most_side * 16, KS_BUFFER_HOST_VISIBLE);
    (void)kuafu_buffer_create(device_, &create, buffers_.out());
    buffers_.keep();
    static constexpr float positions[] = {-9, -9, 2, 9, -9, 2, -9, 9, 2};
    static constexpr uint32_t indices[] = {0, 1, 2};
    kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
    mesh.positions = positions, mesh.vertex_count = 3, mesh.indices = indices, mesh.triangle_count = 1;
    const kuafu_instance_desc instance = kuafu_instance_desc_init(1);
    uint32_t id = 0;
    (void)kuafu_scene_add_mesh(scenes_.latest(), &mesh, &id);
    (void)kuafu_scene_add_instance(scenes_.latest(), &instance, &id);
  }

  void call() {
    static constexpr void (Calls::*kinds[])() = {&Calls::about_buffers, &Calls::about_device, &Calls::about_objects,
                                                 &Calls::about_light,   &Calls::about_ids,    &Calls::about_handles,
                                                 &Calls::about_renders, &Calls::about_renders};
    (this->*kinds[bytes_.below(8)])();
  }

  kuafu_device device() { return bytes_.below(16) == 0 ? nullptr : device_; }
  kuafu_buffer buffer() { return bytes_.below(4) > 0 ? buffers_.latest() : buffers_.pick(bytes_, device_); }
  kuafu_scene scene() { return bytes_.below(8) > 0 ? scenes_.latest() : scenes_.pick(bytes_, device_); }
  kuafu_renderer renderer() { return bytes_.below(8) > 0 ? renderers_.latest() : renderers_.pick(bytes_, device_); }
  uint32_t id() { return bytes_.below(4) > 0 ? bytes_.below(4) : static_cast<uint32_t>(bytes_.size()); }
  template <class T>
  const T* or_null(const T& value) {
    return bytes_.below(32) == 0 ? nullptr : &value;
  }
  const double* pose() {
    for (size_t i = 0; i < 16; ++i) pose_[i] = i % 5 == 0;
    for (uint32_t n = bytes_.below(4); n > 0; --n) pose_[bytes_.below(16)] = bytes_.number();
    return bytes_.below(32) == 0 ? nullptr : pose_.data();
  }

  void about_buffers() {
    ks_buffer_create_desc create = ks_buffer_create_desc_init(bytes_.size(), bytes_.below(4));
    switch (bytes_.below(6)) {
      case 0:
        bytes_.disturb(create);
        // Memory that the machine would not give is refused; what it would give is not asked for here.
        if (create.size_bytes > host_bytes && create.size_bytes < uint64_t{1} << 45) create.size_bytes = host_bytes;
        (void)kuafu_buffer_create(device(), or_null(create), buffers_.out());
        return buffers_.keep();
      case 1: {
        ks_buffer_desc desc = ks_buffer_desc_init();
        desc.memory = KS_MEMORY_HOST;
        desc.handle = reinterpret_cast<uint64_t>(host_);
        desc.allocation_bytes = desc.size_bytes = host_bytes;
        bytes_.disturb(desc);
        // An address that is none, and more bytes than there are, no call can know.
        desc.handle = desc.memory == KS_MEMORY_HOST ? reinterpret_cast<uint64_t>(host_) : UINT64_MAX;
        if (desc.allocation_bytes > host_bytes) desc.allocation_bytes = host_bytes;
        (void)kuafu_buffer_import(device(), or_null(desc), buffers_.out());
        return buffers_.keep();
      }
      case 2: {
        ks_buffer_desc desc = ks_buffer_desc_init();
        const uint32_t memory = bytes_.below(2) > 0 ? KS_MEMORY_HOST : id();
        if (memory != KS_MEMORY_OPAQUE_FD) (void)kuafu_buffer_export(buffer(), memory, &desc);
        return;
      }
      case 3: {
        void* mapped = nullptr;
        (void)kuafu_buffer_map(buffer(), &mapped);
        return;
      }
      case 4: {
        const uint64_t size = bytes_.size();
        (void)kuafu_buffer_write(buffer(), bytes_.size(), host_, size);
        return;
      }
      default: {
        const uint64_t size = bytes_.size();
        (void)kuafu_buffer_read(buffer(), bytes_.size(), host_, size);
      }
    }
  }

  void about_device() {
    uint64_t count = 0;
    uint32_t capacity = bytes_.below(4);
    std::array<ks_device_info, 4> infos{ks_device_info_init(), ks_device_info_init(), ks_device_info_init(), ks_device_info_init()};
    switch (bytes_.below(6)) {
      case 0:
        (void)kuafu_device_get_info(device(), infos.data());
        break;
      case 1:
        (void)kuafu_device_copied_bytes(device(), &count);
        break;
      case 2:
        (void)kuafu_device_allocated_bytes(device(), &count);
        break;
      case 3:
        (void)kuafu_device_enumerate(infos.data(), &capacity);
        break;
      case 4: {
        const auto type = static_cast<uint32_t>(bytes_.below(2) > 0 ? 0x1000 + bytes_.below(20) : bytes_.size());
        (void)kuafu_struct_init(type, host_, static_cast<uint32_t>(std::min<uint64_t>(bytes_.size() * 8, host_bytes)));
        break;
      }
      default:
        (void)kuafu_last_error();
    }
  }

  void about_objects() {
    uint32_t id_out = 0;
    switch (bytes_.below(6)) {
      case 0: {
        std::array<float, 3 * vertices> positions{}, normals{}, uvs{};
        std::array<uint32_t, 3 * vertices> indices{};
        for (float& x : positions) x = static_cast<float>(bytes_.number());
        for (float& x : normals) x = static_cast<float>(bytes_.number());
        for (uint32_t& i : indices) i = bytes_.below(vertices + 1);
        kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
        mesh.vertex_count = bytes_.below(vertices + 1), mesh.triangle_count = bytes_.below(vertices + 1);
        mesh.positions = or_null(positions[0]), mesh.indices = or_null(indices[0]);
        if (bytes_.below(2) > 0) mesh.normals = normals.data();
        if (bytes_.below(2) > 0) mesh.uvs = uvs.data();
        if (bytes_.below(2) > 0) mesh.slots = indices.data();
        (void)kuafu_scene_add_mesh(scene(), or_null(mesh), &id_out);
        (void)kuafu_scene_update_mesh(scene(), id(), or_null(positions[0]), mesh.normals, bytes_.below(vertices + 1));
        return;
      }
      case 1: {
        kuafu_texture_desc texture = kuafu_texture_desc_init();
        texture.width = bytes_.below(8), texture.height = bytes_.below(8), texture.channels = bytes_.below(6),
        texture.format = bytes_.below(8);
        texture.srgb = bytes_.below(3);
        texture.texels = or_null(host_[0]);
        if (bytes_.below(2) > 0)
          (void)kuafu_scene_add_texture(scene(), or_null(texture), &id_out);
        else
          (void)kuafu_scene_set_texture(scene(), id(), or_null(texture));
        return;
      }
      case 2: {
        kuafu_material_desc material = kuafu_material_desc_init();
        bytes_.disturb(material);
        material.name = nullptr;
        if (bytes_.below(2) > 0)
          (void)kuafu_scene_add_material(scene(), or_null(material), &id_out);
        else
          (void)kuafu_scene_set_material(scene(), id(), or_null(material));
        (void)kuafu_scene_get_material(scene(), id(), &material);
        return;
      }
      case 3: {
        const std::array<uint32_t, 4> materials{id(), id(), 0, 1};
        kuafu_instance_desc instance = kuafu_instance_desc_init(id());
        bytes_.disturb(instance);
        instance.name = nullptr;
        instance.materials = or_null(materials[0]), instance.material_count = bytes_.below(5);
        (void)kuafu_scene_add_instance(scene(), or_null(instance), &id_out);
        return;
      }
      case 4: {
        const std::array<double, 3> linear{bytes_.number(), bytes_.number(), bytes_.number()};
        (void)kuafu_scene_set_instance_pose(scene(), id(), pose());
        const std::array<uint32_t, 1> moved{id()};
        (void)kuafu_scene_set_instance_poses(scene(), or_null(moved[0]), pose(), bytes_.below(2));
        (void)kuafu_scene_set_instance_velocity(scene(), id(), or_null(linear[0]), or_null(linear[0]));
        const std::array<uint32_t, 2> materials{id(), id()};
        (void)kuafu_scene_set_instance_materials(scene(), id(), or_null(materials[0]), bytes_.below(3));
        return;
      }
      default: {
        static constexpr const char* paths[] = {"", "/", "/dev/null", "nowhere.glb", "a\n.glb", "/dev/null/a.obj", ".glb", "/etc/hostname"};
        (void)kuafu_scene_load(scene(), bytes_.below(16) == 0 ? nullptr : paths[bytes_.below(8)], paths[bytes_.below(8)], pose());
      }
    }
  }

  void about_light() {
    uint32_t id_out = 0;
    switch (bytes_.below(3)) {
      case 0: {
        const std::array<float, 12> dots{0.5f, 0.5f, 1.0f, static_cast<float>(bytes_.number()),
                                         0.1f, 1.0f, 0.2f, static_cast<float>(bytes_.number())};
        kuafu_light_desc light = kuafu_light_desc_init(bytes_.below(8));
        for (float& value : light.intensity) value = 1.0f;
        if (bytes_.below(2) > 0) light.dots = dots.data(), light.pattern_width = bytes_.below(64), light.pattern_height = bytes_.below(64);
        const float* const given = light.dots;
        bytes_.disturb(light);
        light.name = nullptr, light.dots = given, light.dot_count = bytes_.below(4);
        if (bytes_.below(3) > 0)
          (void)kuafu_scene_add_light(scene(), or_null(light), &id_out);
        else
          (void)kuafu_scene_set_light(scene(), id(), or_null(light));
        const std::array<uint32_t, 1> changed{id()};
        (void)kuafu_scene_set_lights(scene(), or_null(changed[0]), or_null(light), bytes_.below(2));
        (void)kuafu_scene_get_light(scene(), id(), &light);
        return;
      }
      case 1: {
        kuafu_environment_desc environment = kuafu_environment_desc_init();
        bytes_.disturb(environment);
        (void)kuafu_scene_set_environment(scene(), or_null(environment));
        return;
      }
      default: {
        kuafu_medium_desc medium = kuafu_medium_desc_init();
        bytes_.disturb(medium);
        (void)kuafu_scene_set_medium(scene(), or_null(medium));
      }
    }
  }

  void about_ids() {
    kuafu_camera_desc camera = kuafu_camera_desc_init();
    kuafu_scene_summary summary = kuafu_scene_summary_init();
    static constexpr std::array removals{kuafu_scene_remove_mesh, kuafu_scene_remove_texture, kuafu_scene_remove_material,
                                         kuafu_scene_remove_instance, kuafu_scene_remove_light};
    const uint32_t kind = bytes_.below(8);
    if (kind < removals.size()) return void(removals[kind](scene(), id()));
    switch (kind) {
      case 5:
        (void)kuafu_scene_instance_name(scene(), id()), (void)kuafu_scene_material_name(scene(), id());
        break;
      case 6:
        (void)kuafu_scene_get_camera(scene(), id(), &camera), (void)kuafu_scene_next_frame(scene());
        break;
      default:
        bytes_.disturb(summary), (void)kuafu_scene_get_summary(scene(), &summary);
        double seconds = bytes_.below(2) == 0 ? 0.5 : NAN;
        (void)kuafu_scene_animate(scene(), bytes_.below(2) == 0 ? KUAFU_ALL_ANIMATIONS : id(), seconds);
        (void)kuafu_scene_animation_duration(scene(), id(), &seconds), (void)kuafu_scene_animation_name(scene(), id());
    }
  }

  void about_handles() {
    switch (bytes_.below(6)) {
      case 0:
        return buffers_.retain_or_release(bytes_);
      case 1:
        return scenes_.retain_or_release(bytes_);
      case 2:
        return renderers_.retain_or_release(bytes_);
      case 3:
        (void)kuafu_scene_create(device(), scenes_.out());
        return scenes_.keep();
      default: {
        kuafu_renderer_desc desc = kuafu_renderer_desc_init();
        desc.tracer = bytes_.below(8) > 0 ? KUAFU_TRACER_EMBREE : static_cast<uint32_t>(bytes_.size());
        if (desc.tracer == KUAFU_TRACER_COMPUTE) desc.tracer = KUAFU_TRACER_AUTO;  // lavapipe takes seconds to compile it
        (void)kuafu_renderer_create(device(), or_null(desc), renderers_.out());
        renderers_.keep();
      }
    }
  }

  void about_renders() {
    ks_sync sync = ks_sync_init();
    if (bytes_.below(2) > 0) return render(nullptr);
    switch (bytes_.below(4)) {
      case 0:
        return render(&sync);
      case 1:
        sync.kind = bytes_.below(4), sync.value = bytes_.size();
        (void)kuafu_renderer_wait(renderer(), or_null(sync), bytes_.below(2) == 0 ? 0 : 1000000);
        return;
      case 2:
        (void)kuafu_renderer_cancel(renderer());
        return;
      default: {
        kuafu_render_summary summary = kuafu_render_summary_init();
        uint32_t count = 4;
        std::array<ks_stage_time, 4> times{};
        (void)kuafu_renderer_get_summary(renderer(), &summary);
        (void)kuafu_renderer_get_stage_times(renderer(), times.data(), &count);
      }
    }
  }

  /// Of a wait afterwards where a sync is given.
  void render(ks_sync* sync) {
    kuafu_optics_desc optics = kuafu_optics_desc_init();
    bytes_.disturb(optics);
    const uint32_t side = 1 + bytes_.below(most_side);
    kuafu_view_desc view = kuafu_view_desc_init();
    view.band = bytes_.below(2);
    view.camera.width = view.camera.height = side;
    view.camera.k[0] = view.camera.k[4] = side, view.camera.k[2] = view.camera.k[5] = side * 0.5;
    bytes_.disturb(view);
    view.optics = bytes_.below(3) == 0 ? &optics : nullptr;
    const uint64_t shape[4] = {1, side, side, view.band == KUAFU_BAND_INFRARED ? 1u : 3u};
    kuafu_output_desc output = kuafu_output_desc_init(bytes_.below(4) > 0 ? KUAFU_OUTPUT_RADIANCE : bytes_.below(32), nullptr,
                                                      ks_image_desc_packed(KS_FORMAT_F32, 4, shape));
    bytes_.disturb(output);
    output.buffer = buffer();
    kuafu_render_desc desc = kuafu_render_desc_init();
    desc.samples_per_pixel = 1;
    bytes_.disturb(desc);
    ks_sync wait = ks_sync_init();
    bytes_.disturb(wait);
    wait.handle = UINT64_MAX;  // no file descriptor of this process
    desc.wait = bytes_.below(8) == 0 ? &wait : nullptr;
    int questions = 20;
    desc.views = or_null(view), desc.view_count = bytes_.below(16) > 0 ? 1 : 0;
    desc.outputs = or_null(output), desc.output_count = bytes_.below(16) > 0 ? 1 : 0;
    desc.progress = end_after_some_questions, desc.progress_user = &questions;  // a billion samples are allowed, and not waited for
    const kuafu_renderer renderer_used = renderer();
    if (sync == nullptr) {
      (void)kuafu_renderer_render(renderer_used, scene(), or_null(desc));
    } else if (kuafu_renderer_submit(renderer_used, scene(), or_null(desc), sync) == KS_OK) {
      (void)kuafu_scene_next_frame(scenes_.latest());
      if (bytes_.below(4) == 0) (void)kuafu_renderer_cancel(renderer_used);
      (void)kuafu_renderer_wait(renderer_used, sync, UINT64_MAX);
    }
  }

  alignas(4096) unsigned char host_[host_bytes]{};
  std::array<double, 16> pose_{};
  kuafu_device device_;
  Bytes bytes_;
  Buffers buffers_;
  Scenes scenes_;
  Renderers renderers_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const kuafu_device device = open_device();
  Calls(device, data, size).run();
  return 0;
}
