// SPDX-License-Identifier: Apache-2.0
// The glTF reader's top: extensions, meshes and materials once each, then the node tree, which places them.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>

#include "device/error.h"
#include "import/gltf_material.h"
#include "import/gltf_mesh.h"
#include "import/gltf_rig.h"

namespace kuafu {
namespace {

constexpr std::array known_extensions = {"KHR_materials_ior",
                                         "KHR_materials_transmission",
                                         "KHR_materials_specular",
                                         "KHR_materials_volume",
                                         "KHR_materials_emissive_strength",
                                         "KHR_materials_unlit",
                                         "KHR_lights_punctual",
                                         "KHR_mesh_quantization",
                                         "KHR_texture_transform",
                                         "EXT_texture_webp",
                                         "EXT_mesh_gpu_instancing",
                                         "KHR_draco_mesh_compression",
                                         "EXT_meshopt_compression",
                                         "KHR_materials_clearcoat",
                                         "KHR_materials_diffuse_transmission",
                                         "KHR_materials_anisotropy",
                                         "KHR_materials_sheen",
                                         "KHR_materials_iridescence",
                                         "KHR_materials_dispersion"};

bool is_known(const std::string& extension) {
  return std::find(known_extensions.begin(), known_extensions.end(), extension) != known_extensions.end();
}

void check_extensions(Import& import, const tinygltf::Model& model) {
  for (const std::string& extension : model.extensionsRequired)
    if (!is_known(extension))
      ks::fail(KS_ERROR_UNSUPPORTED, "extensionsRequired: %.100s is not supported, export the file without it", extension.c_str());
  for (const std::string& extension : model.extensionsUsed)
    if (!is_known(extension)) import.warn("extension " + extension + " is ignored");
}

// glTF's cameras and lights look along -z with y up (section 3.10); ours along +z with y down.
const glm::dmat4 camera_to_node(glm::dvec4(1, 0, 0, 0), glm::dvec4(0, -1, 0, 0), glm::dvec4(0, 0, -1, 0), glm::dvec4(0, 0, 0, 1));

/// KHR_lights_punctual has candela and lux. Writers that know watts (Blender) multiply by the luminous efficacy at 540 THz, which defines
/// the candela (SI brochure, 9th edition, section 2.3.1); we divide by it.
constexpr double lumens_per_watt = 683.0;

/// 0 where the light's extras do not have it.
double number_of_light(const tinygltf::Value& extras, const char* name, const std::string& field) {
  const double value = number_of(extras, name, 0.0);
  if (value < 0.0) ks::fail(KS_ERROR_FILE, "%s: extras.%s of its light is %g, must be at least 0", field.c_str(), name, value);
  return value;
}

/// A light's extras may state its infrared intensity, in W/sr (W/m^2 of a directional light), or its share (kuafu_light_desc), and an
/// extent: a point of radius_m is a sphere, a spot of radius_m or size_m a disk or a rectangle that gives its intensity along the axis.
void read_light_extras(const tinygltf::Value& extras, const std::string& field, Light& to) {
  if (!extras.IsObject()) return;
  if (extras.Has("ir_intensity")) to.ir_intensity = static_cast<float>(number_of_light(extras, "ir_intensity", field));
  to.ir_share = number_of_light(extras, "ir_share", field);
  to.radius_m = number_of_light(extras, "radius_m", field);
  double area_m2 = 1.0;
  if (to.kind == Light::Kind::spot && extras.Has("size_m")) {
    to.kind = Light::Kind::rectangle;
    for (int i = 0; i < 2; ++i) to.size_m[i] = extras.Get("size_m").Get(i).GetNumberAsDouble();
    area_m2 = to.size_m[0] * to.size_m[1];
  } else if (to.kind == Light::Kind::spot && to.radius_m > 0.0) {
    to.kind = Light::Kind::disk;
    area_m2 = glm::pi<double>() * to.radius_m * to.radius_m;
  }
  if (!(area_m2 > 0.0)) ks::fail(KS_ERROR_FILE, "%s: extras.size_m of its light must be two numbers above 0", field.c_str());
  to.intensity /= static_cast<float>(area_m2);
  to.ir_intensity /= static_cast<float>(area_m2);
}

/// The rotation and translation of a node: what cameras and lights take from it.
glm::dmat4 turned(const glm::dmat4& node_to_world, const std::string& field) {
  const std::optional<glm::dmat4> out = without_scale(node_to_world);
  if (!out) ks::fail(KS_ERROR_FILE, "%s has no rotation: its axes have no length", field.c_str());
  return *out;
}

bool has_joints(const tinygltf::Mesh& mesh) {
  return std::ranges::any_of(mesh.primitives, [](const tinygltf::Primitive& p) { return p.attributes.contains("JOINTS_0"); });
}

bool has_targets(const tinygltf::Mesh& mesh) {
  return std::ranges::any_of(mesh.primitives, [](const tinygltf::Primitive& p) { return !p.targets.empty(); });
}

class Nodes {
 public:
  Nodes(Import& import, const tinygltf::Model& model, GltfMaterials& materials)
      : import_(import), model_(model), materials_(materials), rig_(import, model) {}

  void place_all() {
    visited_.assign(model_.nodes.size(), false);
    meshes_.resize(model_.meshes.size());
    struct Pending {
      size_t node;
      uint32_t parent;  // in the rig
      glm::dmat4 parent_to_world;
    };
    std::vector<Pending> stack;
    const std::vector<int> first = roots();
    for (auto root = first.rbegin(); root != first.rend(); ++root) stack.push_back({checked(*root, "scenes"), none, import_.root_to_world});
    while (!stack.empty()) {
      const Pending next = stack.back();
      stack.pop_back();
      const tinygltf::Node& node = model_.nodes[next.node];
      const std::string field = "nodes[" + std::to_string(next.node) + "] '" + node.name + "'";
      if (visited_[next.node]) ks::fail(KS_ERROR_FILE, "%s has two parents or is its own ancestor", field.c_str());
      visited_[next.node] = true;
      const uint32_t number = rig_.add_node(next.node, next.parent, field);
      const glm::dmat4 node_to_world = next.parent_to_world * rig_.node_to_parent(number);
      place({node, number, node_to_world, field});
      for (auto child = node.children.rbegin(); child != node.children.rend(); ++child)
        stack.push_back({checked(*child, field), number, node_to_world});
    }
    rig_.finish();
  }

 private:
  size_t checked(int node, const std::string& field) const {
    if (node < 0 || static_cast<size_t>(node) >= model_.nodes.size())
      ks::fail(KS_ERROR_FILE, "%s: node %d of %zu", field.c_str(), node, model_.nodes.size());
    return static_cast<size_t>(node);
  }

  /// The default scene's roots; of a file without scenes, every node that is nobody's child.
  std::vector<int> roots() const {
    if (!model_.scenes.empty()) {
      const int scene = std::max(model_.defaultScene, 0);
      if (static_cast<size_t>(scene) >= model_.scenes.size()) ks::fail(KS_ERROR_FILE, "scene is %d of %zu", scene, model_.scenes.size());
      return model_.scenes[static_cast<size_t>(scene)].nodes;
    }
    std::vector<bool> child(model_.nodes.size(), false);
    for (const tinygltf::Node& node : model_.nodes)
      for (const int c : node.children) child[checked(c, "children")] = true;
    std::vector<int> out;
    for (size_t i = 0; i < child.size(); ++i)
      if (!child[i]) out.push_back(static_cast<int>(i));
    return out;
  }

  /// A node on its way into the scene.
  struct Place {
    const tinygltf::Node& node;
    uint32_t number;  // in the rig
    glm::dmat4 node_to_world;
    const std::string& field;
  };

  void place(const Place& at) {
    if (at.node.mesh >= 0) place_mesh(at);
    if (at.node.camera >= 0) place_camera(at);
    const auto light = at.node.extensions.find("KHR_lights_punctual");
    if (light != at.node.extensions.end() && light->second.Has("light")) place_light(light->second.Get("light").GetNumberAsInt(), at);
  }

  void place_mesh(const Place& at) {
    const tinygltf::Node& node = at.node;
    const auto index = static_cast<size_t>(node.mesh);
    if (index >= model_.meshes.size()) ks::fail(KS_ERROR_FILE, "%s.mesh is %d of %zu", at.field.c_str(), node.mesh, model_.meshes.size());
    const bool skinned = node.skin >= 0 && has_joints(model_.meshes[index]);
    if (!skinned && !rig_.moves(at.number) && glm::determinant(glm::dmat3(at.node_to_world)) == 0.0) {
      import_.warn(at.field + ": a scale of 0 hides it");
      return;
    }
    if (node.skin >= 0 && !skinned) import_.warn(at.field + " has a skin, but its mesh has no JOINTS_0: the skin is ignored");
    const Loaded mesh = skinned || has_targets(model_.meshes[index]) ? load_deforming(at, index) : load(index);
    if (mesh.id == none) return;
    if (skinned) return void(add_instance(at, mesh, import_.root_to_world));  // its joints place it, not the node
    for (const glm::dmat4& copy_to_node : gpu_instances(import_, model_, node, at.field)) {
      const glm::dmat4 local_to_world = at.node_to_world * copy_to_node;
      if (rig_.moves(at.number))
        rig_.add_member({.kind = RigMember::Kind::instance,
                         .id = add_instance(at, mesh, with_extent(local_to_world)),
                         .node = at.number,
                         .to_node = copy_to_node});
      else if (glm::determinant(glm::dmat3(local_to_world)) == 0.0)
        import_.warn(at.field + ": a scale of 0 hides a copy of it");
      else
        add_instance(at, mesh, local_to_world);
    }
  }

  void place_camera(const Place& at) {
    const auto& [node, number, node_to_world, field] = at;
    if (static_cast<size_t>(node.camera) >= model_.cameras.size())
      ks::fail(KS_ERROR_FILE, "%s.camera is %d of %zu", field.c_str(), node.camera, model_.cameras.size());
    const tinygltf::Camera& from = model_.cameras[static_cast<size_t>(node.camera)];
    if (from.type != "perspective") {
      import_.warn(field + ": a camera of type '" + from.type + "' is ignored");
      return;
    }
    const tinygltf::PerspectiveCamera& lens = from.perspective;
    if (!(lens.yfov > 0.0 && lens.yfov < glm::pi<double>()))
      ks::fail(KS_ERROR_FILE, "%s: camera yfov is %g rad, must be in (0, pi)", field.c_str(), lens.yfov);
    const double aspect = lens.aspectRatio > 0.0 ? lens.aspectRatio : 1.0, focal = 0.5 / std::tan(0.5 * lens.yfov);
    Camera camera;
    camera.name = node.name.empty() ? from.name : node.name;
    camera.k = glm::dmat3(focal, 0, 0, 0, focal, 0, 0.5 * aspect, 0.5, 1);
    camera.camera_to_world = turned(node_to_world, field) * camera_to_node;
    camera.near_m = lens.znear;
    if (lens.zfar > 0.0) camera.far_m = lens.zfar;
    if (rig_.moves(number))
      rig_.add_member({.kind = RigMember::Kind::camera,
                       .id = static_cast<uint32_t>(import_.scene.cameras().size()),
                       .node = number,
                       .to_node = camera_to_node});
    import_.scene.add_camera(std::move(camera));
  }

  void place_light(int index, const Place& at) {
    const auto& [node, number, node_to_world, field] = at;
    if (index < 0 || static_cast<size_t>(index) >= model_.lights.size())
      ks::fail(KS_ERROR_FILE, "%s: light %d of %zu", field.c_str(), index, model_.lights.size());
    const tinygltf::Light& from = model_.lights[static_cast<size_t>(index)];
    Light light;
    if (from.type == "directional" || from.type == "spot") {
      light.kind = from.type == "spot" ? Light::Kind::spot : Light::Kind::directional;
    } else if (from.type != "point") {
      import_.warn(field + ": a light of type '" + from.type + "' is not known and ignored");
      return;
    }
    light.name = node.name.empty() ? from.name : node.name;
    for (int i = 0; i < 3; ++i) {
      const double color = from.color.empty() ? 1.0 : from.color[static_cast<size_t>(i)];
      light.intensity[i] = static_cast<float>(from.intensity * color / lumens_per_watt);
    }
    const bool point = light.kind == Light::Kind::point;  // the others shine along the node's -z, ours along +z
    const glm::dmat4 light_to_node = point ? glm::dmat4(1.0) : camera_to_node;
    light.light_to_world = turned(node_to_world, field) * light_to_node;
    if (light.kind == Light::Kind::spot) {
      light.inner_rad = from.spot.innerConeAngle;
      light.outer_rad = from.spot.outerConeAngle;
    }
    light.range_m = from.range;
    read_light_extras(from.extras, field, light);
    const uint32_t id = import_.scene.add_light(std::move(light));
    if (rig_.moves(number)) rig_.add_member({.kind = RigMember::Kind::light, .id = id, .node = number, .to_node = light_to_node});
  }

  struct Loaded {
    uint32_t id = none;  // none: nothing to render
    std::vector<uint32_t> materials;
  };
  /// Each mesh is read once, however many nodes show it.
  const Loaded& load(size_t index) {
    std::optional<Loaded>& out = meshes_[index];
    if (!out) {
      std::optional<GltfMesh> mesh = read_mesh(import_, model_, index, materials_.uses_uv_1());
      out = mesh ? add(*mesh) : Loaded{};
    }
    return *out;
  }
  /// Each node has its own copy of a mesh whose vertices move.
  Loaded load_deforming(const Place& at, size_t index) {
    std::optional<GltfMesh> mesh = read_mesh(import_, model_, index, materials_.uses_uv_1());
    if (!mesh) return {};
    Loaded out = add(*mesh);
    if (at.node.skin < 0) mesh->skin_weights.clear();
    rig_.add_mesh(at.number, at.node, out.id, std::move(*mesh), at.field);
    return out;
  }
  Loaded add(GltfMesh& mesh) {
    Loaded out;
    for (const int material : mesh.materials) out.materials.push_back(materials_.id(material, "mesh '" + mesh.mesh.name + "'"));
    out.id = import_.scene.add_mesh(std::move(mesh.mesh));
    return out;
  }
  uint32_t add_instance(const Place& at, const Loaded& mesh, const glm::dmat4& local_to_world) {
    Instance instance;
    instance.name = at.node.name.empty() ? model_.meshes[static_cast<size_t>(at.node.mesh)].name : at.node.name;
    instance.mesh = mesh.id;
    instance.materials = mesh.materials;
    instance.local_to_world = local_to_world;
    return import_.scene.add_instance(std::move(instance));
  }

  Import& import_;
  const tinygltf::Model& model_;
  GltfMaterials& materials_;
  GltfRig rig_;
  std::vector<bool> visited_;
  std::vector<std::optional<Loaded>> meshes_;
};

}  // namespace

void import_gltf(Import& import) {
  const tinygltf::Model model = read_gltf(import);
  check_extensions(import, model);
  GltfMaterials materials(import, model);
  materials.add_all();
  Nodes(import, model, materials).place_all();
}

}  // namespace kuafu
