// SPDX-License-Identifier: Apache-2.0
// The glTF reader's top: extensions, meshes and materials once each, then the node tree, which places them.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>

#include "device/error.h"
#include "import/gltf_instancing.h"
#include "import/gltf_material.h"
#include "import/gltf_mesh.h"

namespace kuafu {
namespace {

constexpr std::array known_extensions = {"KHR_materials_ior",       "KHR_materials_transmission",      "KHR_materials_specular",
                                         "KHR_materials_volume",    "KHR_materials_emissive_strength", "KHR_lights_punctual",
                                         "KHR_mesh_quantization",   "KHR_texture_transform",           "EXT_texture_webp",
                                         "EXT_mesh_gpu_instancing", "KHR_draco_mesh_compression",      "EXT_meshopt_compression"};

bool is_known(const std::string& extension) {
  return std::find(known_extensions.begin(), known_extensions.end(), extension) != known_extensions.end();
}

void check_extensions(Import& import, const tinygltf::Model& model) {
  for (const std::string& extension : model.extensionsRequired)
    if (!is_known(extension))
      ks::fail(KS_ERROR_UNSUPPORTED, "extensionsRequired: %.100s is not supported, export the file without it", extension.c_str());
  for (const std::string& extension : model.extensionsUsed)
    if (!is_known(extension)) import.warn("extension " + extension + " is ignored");
  if (!model.animations.empty()) import.warn("animations are ignored");
  if (!model.skins.empty()) import.warn("skins are ignored");
}

/// Coordinates in the node to those in its parent (glTF 2.0 section 3.5.3).
glm::dmat4 node_to_parent(const tinygltf::Node& node, const std::string& field) {
  if (!node.matrix.empty()) return glm::make_mat4(node.matrix.data());
  glm::dmat4 out(1.0);
  if (!node.rotation.empty()) {
    const glm::dquat q(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
    if (!(glm::length(q) > 0.5)) ks::fail(KS_ERROR_FILE, "%s.rotation has length %g, must be 1", field.c_str(), glm::length(q));
    out = glm::mat4_cast(glm::normalize(q));
  }
  if (!node.scale.empty())
    for (int i = 0; i < 3; ++i) out[i] *= node.scale[static_cast<size_t>(i)];
  if (!node.translation.empty()) out[3] = glm::dvec4(node.translation[0], node.translation[1], node.translation[2], 1.0);
  return out;
}

// glTF's cameras and lights look along -z with y up (section 3.10); ours along +z with y down.
const glm::dmat4 camera_to_node(glm::dvec4(1, 0, 0, 0), glm::dvec4(0, -1, 0, 0), glm::dvec4(0, 0, -1, 0), glm::dvec4(0, 0, 0, 1));

/// The rotation and translation of a node, without its scale: what cameras and lights take from it.
glm::dmat4 without_scale(const glm::dmat4& m, const std::string& field) {
  const glm::dvec3 z = glm::normalize(glm::dvec3(m[2]));
  const glm::dvec3 x = glm::normalize(glm::cross(glm::dvec3(m[1]), z));
  const glm::dmat4 out(glm::dvec4(x, 0.0), glm::dvec4(glm::cross(z, x), 0.0), glm::dvec4(z, 0.0), m[3]);
  for (int c = 0; c < 4; ++c)
    if (glm::any(glm::isnan(out[c])) || glm::any(glm::isinf(out[c])))
      ks::fail(KS_ERROR_FILE, "%s has no rotation: its axes have no length", field.c_str());
  return out;
}

class Nodes {
 public:
  Nodes(Import& import, const tinygltf::Model& model, GltfMaterials& materials) : import_(import), model_(model), materials_(materials) {}

  void place_all() {
    visited_.assign(model_.nodes.size(), false);
    meshes_.resize(model_.meshes.size());
    struct Pending {
      size_t node;
      glm::dmat4 parent_to_world;
    };
    std::vector<Pending> stack;
    const std::vector<int> first = roots();
    for (auto root = first.rbegin(); root != first.rend(); ++root) stack.push_back({checked(*root, "scenes"), import_.root_to_world});
    while (!stack.empty()) {
      const Pending next = stack.back();
      stack.pop_back();
      const tinygltf::Node& node = model_.nodes[next.node];
      const std::string field = "nodes[" + std::to_string(next.node) + "] '" + node.name + "'";
      if (visited_[next.node]) ks::fail(KS_ERROR_FILE, "%s has two parents or is its own ancestor", field.c_str());
      visited_[next.node] = true;
      const glm::dmat4 node_to_world = next.parent_to_world * node_to_parent(node, field);
      place(node, node_to_world, field);
      for (auto child = node.children.rbegin(); child != node.children.rend(); ++child)
        stack.push_back({checked(*child, field), node_to_world});
    }
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

  void place(const tinygltf::Node& node, const glm::dmat4& node_to_world, const std::string& field) {
    if (node.mesh >= 0) place_mesh(node, node_to_world, field);
    if (node.camera >= 0) place_camera(node, node_to_world, field);
    const auto light = node.extensions.find("KHR_lights_punctual");
    if (light != node.extensions.end() && light->second.Has("light"))
      place_light(light->second.Get("light").GetNumberAsInt(), node, node_to_world, field);
  }

  void place_mesh(const tinygltf::Node& node, const glm::dmat4& node_to_world, const std::string& field) {
    const auto index = static_cast<size_t>(node.mesh);
    if (index >= model_.meshes.size()) ks::fail(KS_ERROR_FILE, "%s.mesh is %d of %zu", field.c_str(), node.mesh, model_.meshes.size());
    if (glm::determinant(glm::dmat3(node_to_world)) == 0.0) {
      import_.warn(field + ": a scale of 0 hides it");
      return;
    }
    const Loaded& mesh = load(index);
    if (mesh.id == none) return;
    for (const glm::dmat4& copy_to_node : gpu_instances(import_, model_, node, field)) {
      Instance instance;
      instance.name = node.name.empty() ? model_.meshes[index].name : node.name;
      instance.mesh = mesh.id;
      instance.materials = mesh.materials;
      instance.local_to_world = node_to_world * copy_to_node;
      if (glm::determinant(glm::dmat3(instance.local_to_world)) == 0.0)
        import_.warn(field + ": a scale of 0 hides a copy of it");
      else
        import_.scene.add_instance(std::move(instance));
    }
  }

  void place_camera(const tinygltf::Node& node, const glm::dmat4& node_to_world, const std::string& field) {
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
    camera.camera_to_world = without_scale(node_to_world, field) * camera_to_node;
    camera.near_m = lens.znear;
    if (lens.zfar > 0.0) camera.far_m = lens.zfar;
    import_.scene.add_camera(std::move(camera));
  }

  void place_light(int index, const tinygltf::Node& node, const glm::dmat4& node_to_world, const std::string& field) {
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
    for (int i = 0; i < 3; ++i)
      light.intensity[i] = static_cast<float>(from.intensity * (from.color.empty() ? 1.0 : from.color[static_cast<size_t>(i)]));
    light.light_to_world = without_scale(node_to_world, field);
    if (light.kind != Light::Kind::point) light.light_to_world *= camera_to_node;  // they shine along the node's -z, ours along +z
    if (light.kind == Light::Kind::spot) {
      light.inner_rad = from.spot.innerConeAngle;
      light.outer_rad = from.spot.outerConeAngle;
    }
    light.range_m = from.range;
    import_.scene.add_light(std::move(light));
  }

  struct Loaded {
    bool done = false;
    uint32_t id = none;  // none: nothing to render
    std::vector<uint32_t> materials;
  };
  /// Each mesh is read once, however many nodes show it.
  const Loaded& load(size_t index) {
    Loaded& out = meshes_[index];
    if (out.done) return out;
    out.done = true;
    std::optional<GltfMesh> mesh = read_mesh(import_, model_, index, materials_.uses_uv_1());
    if (!mesh) return out;
    for (const int material : mesh->materials) out.materials.push_back(materials_.id(material, "mesh '" + mesh->mesh.name + "'"));
    out.id = import_.scene.add_mesh(std::move(mesh->mesh));
    return out;
  }

  Import& import_;
  const tinygltf::Model& model_;
  GltfMaterials& materials_;
  std::vector<bool> visited_;
  std::vector<Loaded> meshes_;
};

}  // namespace

void read_scene_file(Import& import) { import_gltf(import); }

void import_gltf(Import& import) {
  const tinygltf::Model model = read_gltf(import);
  check_extensions(import, model);
  GltfMaterials materials(import, model);
  materials.add_all();
  Nodes(import, model, materials).place_all();
}

}  // namespace kuafu
