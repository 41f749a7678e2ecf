# SPDX-License-Identifier: Apache-2.0
"""Writes reports for people: pictures and browser pages of comparisons, diagnoses and simulated frames.

write           compare.json, compare.png and report.html of a comparison, with a diagnosis beside it
write_diagnosis diagnose.json and model.json
overview        one picture of a simulated frame
view            the local page of `activestereo view`
overlay         a scene's contours over pictures
"""
