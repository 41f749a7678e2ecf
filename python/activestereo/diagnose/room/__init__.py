# SPDX-License-Identifier: Apache-2.0
"""Diagnoses a room that one camera recorded: scene, dots and camera are unknowns of one model, and nothing is rendered.

bands      splits an image into four bands, each with errors of its own
light      estimates the light expected in every image from all images
columns    computes how images change by each effect, and by errors of the calibration
cells_out  projects the cells' radiances out, and sums information and scores by tiles
evidence   computes how much likelier an effect is than none
beside     finds what no column shows: row noise, drops on a window, pitch, a bent response, falloff
names      names the effects that a room shows
unseen     predicts held-out views from the others
further    adds views to a room: from a session when the camera was good, or planned ones
plan       suggests recordings, with the effects that each would detect
diagnosed  writes the diagnosis as diagnose.json holds it
"""
