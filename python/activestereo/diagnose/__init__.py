# SPDX-License-Identifier: Apache-2.0
"""Which physical effect does the model of a capture lack?

evidence   what is looked at: images beside their rendered light, noise, tiles
propose    where fits start
refine     fits of parameters and nuisances
channels   what effects are judged on, one class each
score      what explanations are worth
verdict    what findings allow to say, as pure functions
answer     what a diagnosis says, as data
rank.py    the way through them; findings.py: the records that they hand on; thresholds.py: every threshold
"""

from activestereo.diagnose.diagnosis import Diagnosis, Settings, diagnose, examine

__all__ = ["Diagnosis", "Settings", "diagnose", "examine"]
