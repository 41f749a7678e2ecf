#version 460
#extension GL_GOOGLE_include_directive : require
#define KUAFU_CHANNELS 1
#include "entry/transmit_main.glsl"
