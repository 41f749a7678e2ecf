# SPDX-License-Identifier: Apache-2.0
"""The report of a comparison and of a diagnosis: JSON, a picture, and one HTML page that is explored without a network.

    write_report(comparison, "out/table")                  # compare.json, compare.png, report.html

What it takes from the rest of the lab is narrow: a Comparison (lab/compare.py) and, where there is one, what
diagnose.json holds, a dict.

    write      the files                     models     expected images under the models that the page shows
    page       the document and its parts    encode     images as pictures of whole numbers with a known step
    explorer   the part that is explored     web/       its style, its template and its scripts
    comparison, diagnosis, charts, sheet     sections, charts and compare.png
"""

from activestereo.lab.report.summary import summary_table
from activestereo.lab.report.write import report_page, write_report

__all__ = ["report_page", "summary_table", "write_report"]
