// Plain arrays behind device addresses.
#ifndef KUAFU_ARRAYS_GLSL
#define KUAFU_ARRAYS_GLSL
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_scalar_block_layout : require

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer UintArray { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer FloatArray { float at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Vec2Array { vec2 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Vec3Array { vec3 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer UVec3Array { uvec3 at[]; };

layout(buffer_reference) buffer InstanceArray;
layout(buffer_reference) buffer MaterialArray;
layout(buffer_reference) buffer TextureArray;
layout(buffer_reference) buffer LightArray;
layout(buffer_reference) buffer EnvironmentArray;
#endif
