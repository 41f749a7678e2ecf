#version 460
#extension GL_GOOGLE_include_directive : require
#define KUAFU_CHANNELS 3
#include "entry/shade_main.glsl"
