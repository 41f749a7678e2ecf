# SPDX-License-Identifier: Apache-2.0
"""Makes data sets of depth pictures of objects on a table, with poses, masks and true depth: `activestereo generate`.

| file | job |
|--|--|
| layout.py | objects, ranges of random values, layouts: side by side, or dropped with physics |
| studio.py | one frame: layout, camera, light, pictures |
| bop.py | folders and files of the BOP format |
| ray_actors.py | frames from the machines of a Ray cluster |
| run.py | workers, resuming, progress, other formats |

Frame n depends only on the settings, the seed and n. Neither workers nor interruptions change a picture.
"""
