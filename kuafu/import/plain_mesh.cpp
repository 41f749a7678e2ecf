// SPDX-License-Identifier: Apache-2.0
#include "import/plain_mesh.h"

#include <assimp/scene.h>

#include <algorithm>

#include "device/error.h"

namespace kuafu {
namespace {

constexpr double most_rounding = 1e-5;  // of the largest coordinate: assimp reads decimals in single precision

PlainMesh taken(const aiScene& read) {
  PlainMesh mesh;
  for (unsigned m = 0; m < read.mNumMeshes; ++m)
    for (unsigned f = 0; f < read.mMeshes[m]->mNumFaces; ++f) {
      const aiFace& face = read.mMeshes[m]->mFaces[f];
      if (face.mNumIndices < 3) continue;
      ++mesh.faces;
      mesh.corners += face.mNumIndices;
      for (unsigned k = 0; k < face.mNumIndices; ++k) {
        const aiVector3D& p = read.mMeshes[m]->mVertices[face.mIndices[k]];
        mesh.use({p.x, p.y, p.z});
      }
    }
  return mesh;
}

}  // namespace

void check_against(const PlainMesh& plain, const aiScene& read) {
  const PlainMesh found = taken(read);
  if (found.faces != plain.faces || found.corners != plain.corners)
    ks::fail(KS_ERROR_FILE, "%llu polygons with %llu corners were read, but the file has %llu with %llu: write it as glTF instead",
             static_cast<unsigned long long>(found.faces), static_cast<unsigned long long>(found.corners),
             static_cast<unsigned long long>(plain.faces), static_cast<unsigned long long>(plain.corners));
  if (plain.faces == 0) return;
  const glm::dvec3 most = glm::max(glm::abs(plain.low), glm::abs(plain.high));
  const double allowed = most_rounding * std::max({most.x, most.y, most.z});
  for (int i = 0; i < 3; ++i)
    if (!(std::abs(found.low[i] - plain.low[i]) <= allowed && std::abs(found.high[i] - plain.high[i]) <= allowed))
      ks::fail(KS_ERROR_FILE, "%c goes from %g to %g as it was read, but from %g to %g in the file: write it as glTF instead", "xyz"[i],
               found.low[i], found.high[i], plain.low[i], plain.high[i]);
}

}  // namespace kuafu
