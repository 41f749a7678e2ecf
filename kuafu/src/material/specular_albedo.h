// Directional albedo of the GGX lobe with Schlick's Fresnel, split into the terms of f0 and f90: E(cosine) = f0 x + f90 y (Karis 2013,
// "split sum"). The BSDF dims the base under a dielectric coat by it. Thread rule: pure function.
#pragma once

#include <glm/glm.hpp>
#include <vector>

namespace kuafu {

/// [roughness][cosine], specular_albedo_size each, both from 0 to 1; then per roughness the mean of x + y over the hemisphere, as x.
std::vector<glm::vec2> specular_albedo_table();

/// One entry by quadrature over the visible normals.
glm::vec2 specular_albedo(double cosine, double roughness);

}  // namespace kuafu
