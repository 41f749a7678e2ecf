// SPDX-License-Identifier: Apache-2.0
// Arrays behind addresses, read by GLSL and C++: `a.at[i]` in both. In C++ they hold a device address (never followed) or, for stages on the host, a pointer.
#ifndef KUAFU_ARRAYS_H
#define KUAFU_ARRAYS_H

#ifdef __cplusplus
#include <cstdint>
#include <glm/glm.hpp>
namespace kuafu {
using glm::uvec3;
using glm::vec2;
using glm::vec3;
using glm::vec4;

template <class T>
struct AddressedArray {
  T* at = nullptr;
  AddressedArray() = default;
  AddressedArray(uint64_t address) : at(reinterpret_cast<T*>(address)) {}
};
using UintArray = AddressedArray<uint32_t>;
using FloatArray = AddressedArray<float>;
using Vec2Array = AddressedArray<const vec2>;
using Vec3Array = AddressedArray<const vec3>;
using Vec4Array = AddressedArray<const vec4>;
using UVec3Array = AddressedArray<const uvec3>;
#define KUAFU_ARRAY(Name, Record, alignment) using Name = AddressedArray<const Record>;
#define KUAFU_WRITTEN_ARRAY(Name, Record, alignment) using Name = AddressedArray<Record>;
}  // namespace kuafu
#else
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_scalar_block_layout : require
#define KUAFU_ARRAY(Name, Record, alignment) \
  layout(buffer_reference, scalar, buffer_reference_align = alignment) buffer Name { Record at[]; };
#define KUAFU_WRITTEN_ARRAY(Name, Record, alignment) KUAFU_ARRAY(Name, Record, alignment)
KUAFU_ARRAY(UintArray, uint, 4)
KUAFU_ARRAY(FloatArray, float, 4)
KUAFU_ARRAY(Vec2Array, vec2, 4)
KUAFU_ARRAY(Vec3Array, vec3, 4)
KUAFU_ARRAY(Vec4Array, vec4, 4)
KUAFU_ARRAY(UVec3Array, uvec3, 4)
#endif
#endif
