// SPDX-License-Identifier: Apache-2.0
#include "stages/prepared_rig.h"

namespace simsense {
namespace {

const simsense_rig_desc& checked(const simsense_rig_desc& rig) {
  check_rig(rig);
  return rig;
}

PixelRays point_rays(const simsense_rig_desc& rig, const StereoGeometry& geometry) {
  return rig.rgb.width ? PixelRays(rig.rgb) : PixelRays(geometry.camera, rig.left.width, rig.left.height);
}

}  // namespace

PreparedRig::PreparedRig(const simsense_rig_desc& desc)
    : rig(checked(desc)), rectification(make_rectification(rig)), rays(point_rays(rig, rectification.geometry)) {
  if (rig.rgb.width) rgb.emplace(rig, rectification.geometry);
}

}  // namespace simsense
