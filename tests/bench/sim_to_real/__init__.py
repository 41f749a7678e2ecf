# SPDX-License-Identifier: Apache-2.0
"""Compares a simulated depth camera's ranking of methods with a foreign one's: bench_sim_to_real.py.

| file | job |
|--|--|
| objects.py | eight objects, from clay to glass, and their symmetries |
| views.py | poses of an object and the camera in view n |
| worlds.py | the worlds: modes of depth, and the foreign one |
| stage.py | takes depth pictures of views in a world |
| foreign.py | a world with undisclosed differences, by our renderer |
| foreign_mitsuba.py, mitsuba_scene.py | another, by Mitsuba 3 with its materials; parts of its scenes |
| sgbm.py | the matcher of both |
| clouds.py | points of an object in a depth picture |
| icp.py, ppf.py, features.py, template.py | three methods that find an object's pose |
| methods.py | the methods with the settings that tuning chooses from |
| pose_error.py | the error of a pose, up to symmetry |
| workers.py | processes that share the work |
| files.py | the folder of a run |
| run.py | pictures, tuning, poses, in this order; resumable |
| report.py | tables and pictures of the results |
"""
