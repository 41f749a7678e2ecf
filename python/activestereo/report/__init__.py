# SPDX-License-Identifier: Apache-2.0
"""Writes reports for people: pictures and browser pages of comparisons, diagnoses and simulated frames.

write           compare.json and report.html of a comparison, with a diagnosis beside it, diagnose.json
pictures        a simulated frame, a matched pair or pictures side by side, on one page
view            the local page of `activestereo view`
"""
