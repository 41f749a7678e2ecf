# SPDX-License-Identifier: Apache-2.0
"""How close kinds of simulated depth come to a real camera's, on its own recordings: `activestereo benchmark
realism`."""
