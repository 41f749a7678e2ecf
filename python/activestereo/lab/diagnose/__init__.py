# SPDX-License-Identifier: Apache-2.0
"""Which physical effect does the model of a capture lack?

evidence   what is looked at: images beside their rendered light, noise, tiles
propose    where fits start
refine     fits of parameters and nuisances
channels   what effects are judged on, one class each
score      what explanations are worth
verdict    what findings allow to say, as pure functions
report     diagnose.json, text, and the law of what no effect explains
rank.py    the way through them; findings.py: the records that they hand on; gates.py: every threshold
"""

from activestereo.lab.diagnose.diagnosis import Diagnosis, diagnose, examine
from activestereo.lab.diagnose.report import diagnosis_text, parameter_text, write_diagnosis

__all__ = ["Diagnosis", "diagnose", "diagnosis_text", "examine", "parameter_text", "write_diagnosis"]
