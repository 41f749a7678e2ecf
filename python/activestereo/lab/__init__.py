"""The lab: compare the simulator with a capture, see where it fails."""

from activestereo.lab.compare import Comparison, compare
from activestereo.lab.report import summary_table, write_report

__all__ = ["Comparison", "compare", "summary_table", "write_report"]
