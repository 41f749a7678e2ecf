// SPDX-License-Identifier: Apache-2.0
// Stage `visibility`: takes the light from pixels whose shadow ray of `aov` met something on its way to the projector.
void visibility(uint i) {
  if (uintBitsToFloat(push.shadow_rays.at[occlusion_word(i, ray_t_far, push.shadow_capacity)]) >= 0.0f) return;
  IN(OutputRecord) record = push.outputs.at[output_projector_visibility];
  record.words.at[output_element(record, wave_pixel(push.range, i), 1u)] = floatBitsToUint(0.0f);
}
