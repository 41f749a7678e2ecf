// How many planes of light a pixel has, all images and channels: a constant of the pipeline, so that arrays of them lie in registers.
layout(constant_id = 4) const uint planes = 1u;
uint plane_count() { return planes; }
