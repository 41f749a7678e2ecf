// SPDX-License-Identifier: Apache-2.0
// Collada through assimp: one kuafu mesh per assimp mesh, one instance per node that shows it.
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <new>

#include "device/error.h"
#include "import/assimp_files.h"
#include "import/phong_textures.h"

namespace kuafu {
namespace {

glm::dmat4 to_matrix(const aiMatrix4x4& m) {
  return glm::transpose(glm::dmat4(m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, m.d1, m.d2, m.d3, m.d4));
}

Mesh read_mesh(const aiMesh& from, size_t index) {
  Mesh mesh;
  mesh.name = from.mName.length > 0 ? clean_name(from.mName.C_Str()) : "mesh" + std::to_string(index);
  for (unsigned i = 0; i < from.mNumVertices; ++i) {
    mesh.positions.emplace_back(from.mVertices[i].x, from.mVertices[i].y, from.mVertices[i].z);
    if (from.HasVertexColors(0))
      mesh.colors.push_back(linear_color({from.mColors[0][i].r, from.mColors[0][i].g, from.mColors[0][i].b, from.mColors[0][i].a}));
    if (from.HasTextureCoords(0)) mesh.uvs.emplace_back(from.mTextureCoords[0][i].x, from.mTextureCoords[0][i].y);
  }
  bool unit = from.HasNormals();
  for (unsigned i = 0; unit && i < from.mNumVertices; ++i) {
    const glm::vec3 normal(from.mNormals[i].x, from.mNormals[i].y, from.mNormals[i].z);
    const float length = glm::length(normal);
    mesh.normals.push_back(normal / length);
    unit = length > 0.0f;
  }
  if (!unit) mesh.normals.clear();  // a file with a zero normal gets geometric normals
  for (unsigned i = 0; i < from.mNumFaces; ++i) {
    const aiFace& face = from.mFaces[i];
    if (face.mNumIndices != 3)
      ks::fail(KS_ERROR_FILE, "mesh '%s': face %u has %u corners after triangulation", mesh.name.c_str(), i, face.mNumIndices);
    mesh.indices.emplace_back(face.mIndices[0], face.mIndices[1], face.mIndices[2]);
  }
  return mesh;
}

/// Checks what assimp has read, before triangulation, as assimp 5.2.5 trusts it and then crashes: every face has corners that are vertices
/// of its mesh, and every material exists.
void check_read(const aiScene& file) {
  for (unsigned m = 0; m < file.mNumMeshes; ++m) {
    const aiMesh& mesh = *file.mMeshes[m];
    if (mesh.mMaterialIndex >= file.mNumMaterials)
      ks::fail(KS_ERROR_FILE, "mesh '%s' has material %u of %u", mesh.mName.C_Str(), mesh.mMaterialIndex, file.mNumMaterials);
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices == 0) ks::fail(KS_ERROR_FILE, "mesh '%s': face %u has no corners", mesh.mName.C_Str(), f);
      for (unsigned k = 0; k < face.mNumIndices; ++k)
        if (face.mIndices[k] >= mesh.mNumVertices)
          ks::fail(KS_ERROR_FILE, "mesh '%s': face %u uses vertex %u, but there are %u vertices", mesh.mName.C_Str(), f, face.mIndices[k],
                   mesh.mNumVertices);
    }
  }
}

/// assimp catches what it throws itself, lack of memory among it.
[[noreturn]] void fail_read(const Assimp::Importer& importer) {
  const std::string reason = importer.GetErrorString();
  if (reason.find("bad_alloc") != std::string::npos) throw std::bad_alloc();
  ks::fail(KS_ERROR_FILE, "%s", reason.empty() ? "assimp gives no reason" : reason.c_str());
}

/// assimp's warnings, as long as this lives.
class Listening {
 public:
  explicit Listening(Import& import) {
    Assimp::DefaultLogger::create(nullptr, Assimp::Logger::NORMAL, 0);
    Assimp::DefaultLogger::get()->attachStream(new WarningStream(import), Assimp::Logger::Warn | Assimp::Logger::Err);
  }
  ~Listening() { Assimp::DefaultLogger::kill(); }
  Listening(const Listening&) = delete;
  Listening& operator=(const Listening&) = delete;
};

/// In Collada a colour or an image stands, never both: without its image a body is grey, as one without a material.
Material read_collada_material(Import& import, const aiMaterial& from, PhongTextures& textures) {
  const PhongMaterial phong = phong_of(import, from);
  Material out = read_material(import, phong, textures);
  const bool lacks_image = !phong.map(PhongMap::diffuse).empty() && out.base_color_texture == none;
  if (lacks_image) out.base_color = glm::vec4(PhongMaterial().diffuse, out.base_color.a);
  return out;
}

/// Scene ids of the file's meshes and materials; none = grey default, or a mesh of points and lines only.
struct Tables {
  std::vector<uint32_t> meshes, materials;
  uint32_t colored = none;  // shows vertex colours where there is no material
};

void place(Import& import, const aiScene& file, const Tables& tables) {
  struct Pending {
    const aiNode* node;
    glm::dmat4 parent_to_world;
  };
  std::vector<Pending> stack{{file.mRootNode, import.root_to_world}};
  while (!stack.empty()) {
    const Pending next = stack.back();
    stack.pop_back();
    const glm::dmat4 node_to_world = next.parent_to_world * to_matrix(next.node->mTransformation);
    for (unsigned i = 0; i < next.node->mNumMeshes; ++i) {
      const unsigned mesh = next.node->mMeshes[i];
      if (tables.meshes[mesh] == none) continue;
      Instance instance;
      instance.name = next.node->mName.length > 0 ? clean_name(next.node->mName.C_Str()) : import.scene.meshes()[tables.meshes[mesh]].name;
      instance.mesh = tables.meshes[mesh];
      uint32_t material = tables.materials[file.mMeshes[mesh]->mMaterialIndex];
      if (material == none && file.mMeshes[mesh]->HasVertexColors(0)) material = tables.colored;
      instance.materials = {material};
      instance.local_to_world = node_to_world;
      import.scene.add_instance(std::move(instance));
    }
    for (unsigned i = next.node->mNumChildren; i-- > 0;) stack.push_back({next.node->mChildren[i], node_to_world});
  }
}

}  // namespace

void import_assimp(Import& import) {
  std::vector<uint8_t> bytes = import.folder.read_scene_file();
  bytes = plain_collada(import, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  const Listening listening(import);
  Assimp::Importer importer;
  importer.SetIOHandler(new SceneFiles(import, std::move(bytes)));
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* file = importer.ReadFile(import.path.filename().string(), aiProcess_ValidateDataStructure);
  if (file == nullptr) fail_read(importer);
  check_read(*file);
  file = importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_JoinIdenticalVertices | aiProcess_SortByPType | aiProcess_FlipUVs);
  if (file == nullptr) fail_read(importer);
  if (file->mRootNode == nullptr || file->mNumMeshes == 0) ks::fail(KS_ERROR_FILE, "there are no triangles in it");
  Tables tables;
  PhongTextures textures(import);
  for (unsigned i = 0; i < file->mNumMaterials; ++i) {
    const aiMaterial& material = *file->mMaterials[i];
    const bool made_up = material.GetName() == aiString(AI_DEFAULT_MATERIAL_NAME) || material.GetName().length == 0;
    tables.materials.push_back(made_up ? none : import.scene.add_material(read_collada_material(import, material, textures)));
  }
  for (unsigned i = 0; i < file->mNumMeshes; ++i) {
    const aiMesh& mesh = *file->mMeshes[i];
    tables.meshes.push_back(mesh.mPrimitiveTypes & aiPrimitiveType_TRIANGLE ? import.scene.add_mesh(read_mesh(mesh, i)) : none);
  }
  for (size_t i = 0; i < file->mNumMeshes && tables.colored == none; ++i)
    if (file->mMeshes[i]->HasVertexColors(0) && tables.materials[file->mMeshes[i]->mMaterialIndex] == none)
      tables.colored = import.scene.add_material(colored_material());
  place(import, *file, tables);
}

}  // namespace kuafu
