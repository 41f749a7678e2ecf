# SPDX-License-Identifier: Apache-2.0
"""Makes data sets of depth pictures of objects on a table, with poses, masks and true depth: `activestereo generate`.

| file | job |
|--|--|
| studio.py | one frame: layout (side by side, or dropped with physics), camera, light, pictures |
| bop.py | folders and files of the BOP format |
| formats.py | the same frames in other formats |
| run.py | workers, the machines of a Ray cluster, resuming, progress |

Frame n depends only on the settings, the seed and n. Neither workers nor interruptions change a picture.
"""
