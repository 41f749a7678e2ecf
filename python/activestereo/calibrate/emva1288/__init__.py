# SPDX-License-Identifier: Apache-2.0
"""Measures a camera by EMVA 1288, the standard of machine vision: photon transfer, DSNU, PRNU and defects. The
package emva1288 states the standard's own table of the same files.

recording.py      steps of light and dark, from the standard's descriptor file or from folders
transfer.py       gain, dark noise, response
nonuniformity.py  patterns that are the same in all frames
camera.py         both, as text and in model.json's terms
"""

from activestereo.calibrate.emva1288.camera import Emva1288, calibrate_emva1288, is_emva1288, measure
from activestereo.calibrate.emva1288.recording import Recording, Step, step_of

__all__ = ["Emva1288", "Recording", "Step", "calibrate_emva1288", "is_emva1288", "measure", "step_of"]
