# SPDX-License-Identifier: Apache-2.0
"""A room as one camera recorded it: scene, dots and camera are unknowns of one model, and nothing is rendered.

bands      four linear looks at an image, each with errors of its own
light      the light expected in every image, by all of them
columns    how images change by each effect, and by what calibration has wrong
cells_out  the cells' radiances projected out, sums by tiles
evidence   how much likelier an effect is than none
rows       noise that the rows of one image share
drops      places of one camera that are blurred in every view
names      what may be named
unseen     held-out views as the others predict them
same_place a room with a good session of the same views
imagined   a room with a view that was not recorded yet
plan       what to record for what
diagnosed  all of it as diagnose.json holds it
"""
