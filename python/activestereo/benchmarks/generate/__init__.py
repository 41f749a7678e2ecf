# SPDX-License-Identifier: Apache-2.0
"""Data sets of depth pictures of things on a table, with poses, masks and true depth: `activestereo generate`.

| file | job |
|--|--|
| ranges.py | what is drawn at random, and from which ranges |
| things.py | files of things, and where they are in a scene |
| layout.py | where things lie: side by side, or dropped with physics |
| studio.py | one frame: layout, camera, light, pictures |
| bop.py | folders and files of the BOP format |
| shards.py | the same as tar files for training |
| ray_actors.py | the same by the machines of a Ray cluster |
| run.py | workers, resuming, progress |

Frame n depends on the settings, the seed and n alone; so neither workers nor interruptions change a picture.
"""
