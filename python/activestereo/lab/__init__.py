"""The lab: compare the simulator with a capture, see where it fails, learn which effect is missing, add it."""

from activestereo.lab.compare import Comparison, compare
from activestereo.lab.diagnose import Diagnosis, diagnose
from activestereo.lab.lab_object import Lab
from activestereo.lab.report import summary_table, write_report

__all__ = ["Comparison", "Diagnosis", "Lab", "compare", "diagnose", "summary_table", "write_report"]
