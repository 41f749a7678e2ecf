// SPDX-License-Identifier: Apache-2.0
// The scene as the host knows it: tables with stable ids, and revision counters that tell a renderer what changed since it last looked.
// Thread rule: externally synchronised. Nothing here knows Vulkan; io fills it, accel and pathtrace read it.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/camera.h"
#include "scene/dot_pattern.h"
#include "scene/fields.h"
#include "scene/table.h"

namespace kuafu {

inline constexpr uint32_t light_group_count = 4;  // of all light but projectors'

struct Bounds {
  glm::dvec3 min{std::numeric_limits<double>::infinity()}, max{-std::numeric_limits<double>::infinity()};
};

struct Mesh {
  std::string name;
  std::vector<glm::vec3> positions;  // metres
  std::vector<glm::vec3> normals;    // unit; empty = geometric normals
  std::vector<glm::vec2> uvs;        // empty = 0
  std::vector<glm::vec2> uvs_1;      // the second set; empty = 0
  std::vector<glm::vec4> colors;     // linear RGBA; empty = 1
  // Unit x, y, z along which maps of normals and anisotropy lie; w, 1 or -1: bitangent = cross(normal, xyz) * w. Only with normals; 0 or
  // empty = as the texture coordinates grow.
  std::vector<glm::vec4> tangents;
  std::vector<glm::uvec3> indices;
  std::vector<uint32_t> slots;  // per triangle, index into Instance::materials; empty = 0
  uint64_t deformation = 0;     // how often update_mesh_positions moved its vertices
  Bounds bounds;                // of positions; kept by the scene
};

struct Texture {
  enum class Format : uint32_t { u8, u16, f32 };
  std::string name;
  uint32_t width = 0, height = 0, channels = 0;
  Format format = Format::u8;
  bool srgb = false;
  std::vector<uint8_t> texels;  // row 0 first, packed
  // How materials read it.
  uint32_t wrap_u = 0, wrap_v = 0, filter = 0;  // KUAFU_WRAP_*, KUAFU_FILTER_*
  uint32_t uv_set = 0;                          // Mesh::uvs or uvs_1
  std::array<float, 6> uv_transform{};          // rows of a 2x3 matrix from a mesh's coordinates to the image's; all 0 = none
  uint64_t revision = 0;                        // how often set_texture replaced it
};

struct Material : MaterialFields {};

struct Instance {
  std::string name;
  uint32_t mesh = none;
  uint32_t environment = none;      // none = every environment
  std::vector<uint32_t> materials;  // per slot; none or missing = grey Lambertian
  uint32_t semantic_id = 0;
  glm::dmat4 local_to_world{1.0};  // glm is column-major: column 3 is the translation
  Twist velocity;
  glm::dmat4 previous_local_to_world{1.0};  // kept by the scene: at the last next_frame(), or when it was added
  bool moved = false;                       // since then; kept by the scene
};

struct Light : LightFields {
  Twist velocity;
  [[nodiscard]] bool has_window() const { return on_from_s != on_until_s; }
  DotPattern dots;                        // projector: in place of the texture, where there are any
  std::shared_ptr<const Texture> raster;  // of the dots; made by the scene
};

struct Rig;      // scene/rig.h
struct RigPose;  // scene/rig.h
class Scene;
/// The image that a projector projects.
const Texture& pattern_of(const Scene& scene, const Light& light);

struct Camera {
  std::string name;
  Lens lens;
  Shutter shutter;
  Twist velocity;
  uint32_t width = 0, height = 0;
  glm::dmat3 k{1.0};
  glm::dmat4 camera_to_world{1.0};  // our axes: x right, y down, z forward
  double near_m = 0.0, far_m = std::numeric_limits<double>::infinity();
};

/// Counters that grow when their part of the scene changes. A reader remembers the value that it last saw.
struct Revisions {
  uint64_t meshes = 1, textures = 1, materials = 1, instances = 1, lights = 1;
};

/// Identifies a scene, also against earlier and later ones at its address, as long as someone keeps the token. A copy, or a scene that is
/// assigned to, gets a new token.
class Identity {
 public:
  Identity() = default;
  Identity(const Identity&) : Identity() {}
  Identity& operator=(const Identity& other) {
    if (this != &other) token_ = std::make_shared<const char>();
    return *this;
  }
  [[nodiscard]] const std::shared_ptr<const void>& token() const { return token_; }

 private:
  std::shared_ptr<const void> token_ = std::make_shared<const char>();
};

class Scene {
 public:
  // Each add validates (finite numbers, indices in range, existing ids) and throws ks::Error with the numbers.
  uint32_t add_mesh(Mesh mesh);
  uint32_t add_texture(Texture texture);
  uint32_t add_material(Material material);
  uint32_t add_instance(Instance instance);
  uint32_t add_light(Light light);
  /// Moves a mesh's vertices; triangles stay. Give as many positions as it has vertices, and normals exactly if it has them. Without
  /// `tangents` its tangents stay.
  void update_mesh_positions(uint32_t id, std::vector<glm::vec3> positions, std::vector<glm::vec3> normals,
                             std::vector<glm::vec4> tangents = {});
  /// Replaces a texture's texels; size, channels and format may change.
  void set_texture(uint32_t id, Texture texture);
  void set_material(uint32_t id, Material material);
  void set_instance_pose(uint32_t id, const glm::dmat4& local_to_world) { set_instance_poses({&id, 1}, {&local_to_world, 1}); }
  /// Moves as many instances as there are poses, after all were checked.
  void set_instance_poses(std::span<const uint32_t> ids, std::span<const glm::dmat4> local_to_world);
  /// Begins a new frame: the present poses become the former ones of motion vectors. Its cost depends on what moved.
  void next_frame();
  void set_instance_velocity(uint32_t id, const Twist& velocity);
  void set_instance_materials(uint32_t id, std::vector<uint32_t> materials);
  void set_light(uint32_t id, Light light) { set_lights({&id, 1}, {&light, 1}); }
  /// Replaces as many lights as there are ids, after all were checked; moves them out of `lights`.
  void set_lights(std::span<const uint32_t> ids, std::span<Light> lights);
  void set_environment(const Environment& environment);
  void set_medium(const std::optional<Medium>& medium);
  // Frees what it holds. Refused while something uses it.
  void remove_mesh(uint32_t id);
  void remove_texture(uint32_t id);
  void remove_material(uint32_t id);
  void remove_instance(uint32_t id);
  void remove_light(uint32_t id);
  void add_camera(Camera camera);
  /// Adds the animated part of a loaded file. Its animations are numbered after those of earlier rigs.
  void add_rig(Rig rig);
  /// Poses the animation's nodes at time_s; other nodes of its rig keep the file's pose. `none`: poses every rig by all its animations; the
  /// first counts for a node that several move. Removed objects are skipped. On an error, such as a vertex that is not finite, the scene
  /// stays unchanged.
  void animate(uint32_t animation, double time_s);
  /// Moves all of `other` but its environment to the end of this scene. Its ids grow by the sizes of the tables here.
  void append(Scene&& other);

  [[nodiscard]] const Table<Mesh>& meshes() const { return meshes_; }
  [[nodiscard]] const Table<Texture>& textures() const { return textures_; }
  [[nodiscard]] const Table<Material>& materials() const { return materials_; }
  [[nodiscard]] const Table<Instance>& instances() const { return instances_; }
  /// Maps an instance's slot, which a hit names, to its id; none for a removed one.
  [[nodiscard]] const std::vector<uint32_t>& instance_slots() const { return instances_.ids(); }
  /// Returns the slots of instances that changed, came or went after this value of Revisions::instances. Nothing: read all of them.
  [[nodiscard]] std::optional<std::span<const uint32_t>> instance_changes(uint64_t revision) const { return instance_log_.since(revision); }
  [[nodiscard]] const Table<Light>& lights() const { return lights_; }
  [[nodiscard]] const Environment& environment() const { return environment_; }
  [[nodiscard]] const std::optional<Medium>& medium() const { return medium_; }
  [[nodiscard]] const std::vector<Camera>& cameras() const { return cameras_; }
  [[nodiscard]] const std::vector<std::shared_ptr<const Rig>>& rigs() const { return rigs_; }
  /// The scene's token. Revisions compare only between scenes of the same token.
  [[nodiscard]] const std::shared_ptr<const void>& identity() const { return identity_.token(); }
  [[nodiscard]] const Revisions& revisions() const { return revisions_; }
  /// Whether any instance has a velocity.
  [[nodiscard]] bool instances_move() const { return moving_instances_ > 0; }

  [[nodiscard]] Bounds bounds() const;        // world, of all instances
  [[nodiscard]] Bounds rough_bounds() const;  // around their boxes: no smaller, and found without looking at vertices

 private:
  void check_references(const Material& material) const;
  void check_references(const Light& light) const;
  void check_references(const Environment& environment) const;
  void check_materials(const std::vector<uint32_t>& ids) const;
  struct Posed;
  void gather(const Rig& rig, const RigPose& pose, Posed& to) const;
  void take(Posed&& posed);
  void move_vertices(uint32_t id, std::vector<glm::vec3> positions, std::vector<glm::vec3> normals, std::vector<glm::vec4> tangents);
  void note_instance(uint32_t slot);

  Identity identity_;
  Table<Mesh> meshes_;
  Table<Texture> textures_;
  Table<Material> materials_;
  Table<Instance> instances_;
  uint64_t moving_instances_ = 0;
  ChangeLog instance_log_;
  Table<Light> lights_;
  Environment environment_;
  std::optional<Medium> medium_;
  std::vector<Camera> cameras_;
  std::vector<std::shared_ptr<const Rig>> rigs_;
  Revisions revisions_;
  std::vector<uint32_t> moved_;  // instances, since the frame before
};

}  // namespace kuafu
