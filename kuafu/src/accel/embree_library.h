// SPDX-License-Identifier: Apache-2.0
// Embree, known to nobody else: opened at run time (embree_opened.cpp), or linked from archives whose names are hidden (embree_linked.cpp).
// Linking the shared library would let a host program that defines or loads another Embree (version 4 uses the same function names) take
// our calls; a table of functions cannot be taken. Within namespace kuafu each Embree function is the table's one under its own name.
#pragma once

#include <embree3/rtcore.h>

#define KUAFU_EMBREE_FUNCTIONS(use)                                                                                                   \
  use(rtcNewDevice) use(rtcReleaseDevice) use(rtcGetDeviceError) use(rtcSetDeviceErrorFunction) use(rtcNewScene) use(rtcReleaseScene) \
      use(rtcSetSceneFlags) use(rtcSetSceneProgressMonitorFunction) use(rtcSetSceneBuildQuality) use(rtcCommitScene)                  \
          use(rtcAttachGeometry) use(rtcAttachGeometryByID) use(rtcDetachGeometry) use(rtcNewGeometry) use(rtcReleaseGeometry)        \
              use(rtcCommitGeometry) use(rtcSetNewGeometryBuffer) use(rtcGetGeometryBufferData) use(rtcUpdateGeometryBuffer)          \
                  use(rtcSetGeometryBuildQuality) use(rtcSetGeometryInstancedScene) use(rtcSetGeometryTransform)                      \
                      use(rtcSetGeometryTransformQuaternion) use(rtcSetGeometryTimeStepCount) use(rtcIntersect8) use(rtcOccluded8)    \
                          use(rtcIntersect16) use(rtcOccluded16) use(rtcGetDeviceProperty) use(rtcSetGeometryIntersectFilterFunction) \
                              use(rtcSetGeometryOccludedFilterFunction)

namespace kuafu {

struct EmbreeLibrary {
#define KUAFU_MEMBER(name) decltype(&::name) name;  // NOLINT(bugprone-macro-parentheses): a name cannot stand in parentheses
  KUAFU_EMBREE_FUNCTIONS(KUAFU_MEMBER)
#undef KUAFU_MEMBER
};

/// Returns Embree's functions. The first call opens the library for the life of the process, unless it is linked. Throws
/// KS_ERROR_UNSUPPORTED if there is none.
const EmbreeLibrary& embree_library();

#define KUAFU_FORWARD(name) inline constexpr auto name = [](auto... arguments) { return embree_library().name(arguments...); };
KUAFU_EMBREE_FUNCTIONS(KUAFU_FORWARD)
#undef KUAFU_FORWARD

}  // namespace kuafu
