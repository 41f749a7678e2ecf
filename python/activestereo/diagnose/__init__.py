# SPDX-License-Identifier: Apache-2.0
"""Which physical effect does the model of a capture lack?

evidence   what is looked at: images beside their rendered light, noise, tiles
search     scores of all effects, fits of the few that matter, the verdict
channels   what effects are judged on beside expected images
refine     fits of parameters and nuisances
score      what fits are worth, and what they leave
answer     what a diagnosis says, as data
diagnosis.py: the way through them; numbers.py: every number that decides
"""

from activestereo.diagnose.diagnosis import Diagnosis, Settings, diagnose, examine

__all__ = ["Diagnosis", "Settings", "diagnose", "examine"]
