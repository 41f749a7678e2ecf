"""The lab: compare the simulator with a capture, see where it fails."""

from activestereo.lab.compare import Comparison, compare

__all__ = ["Comparison", "compare"]
