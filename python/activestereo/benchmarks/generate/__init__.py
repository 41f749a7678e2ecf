# SPDX-License-Identifier: Apache-2.0
"""Makes data sets of depth pictures of objects on a table, with poses, masks and true depth: `activestereo generate`.

Frame n depends only on the settings, the seed and n. Neither workers nor interruptions change a picture.
"""
