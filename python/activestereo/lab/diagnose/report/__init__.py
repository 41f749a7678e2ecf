# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis says: diagnose.json, its text, and the law of what no effect explains."""

from activestereo.lab.diagnose.report.text import diagnosis_text, parameter_text
from activestereo.lab.diagnose.report.write import write_diagnosis

__all__ = ["diagnosis_text", "parameter_text", "write_diagnosis"]
