# SPDX-License-Identifier: Apache-2.0
"""A diagnosis's answer as data: figures, ranking, the model that was found, and what no effect explains."""
