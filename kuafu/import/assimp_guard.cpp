// SPDX-License-Identifier: Apache-2.0
#include "import/assimp_guard.h"

#include "device/error.h"

namespace kuafu {

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

}  // namespace kuafu
