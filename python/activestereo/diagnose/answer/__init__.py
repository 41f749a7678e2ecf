# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis says, as data: figures, ranking, the model that was found, and what no effect explains."""
