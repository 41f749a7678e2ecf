# SPDX-License-Identifier: Apache-2.0
"""The end of a command fits ten lines of 80 columns, and its commands keep the words that were meant."""

import subprocess

from activestereo.common.own_files import outside_allowed
from activestereo.report.screen import Figure, command, screen


def test_a_screen_keeps_its_lines_and_its_words():
    notes = ["most important", "a long note " * 14, "told under --verbose alone " * 9]
    figures = [Figure("first", "2.00 DN", 2.0), Figure("second", "1.00 DN", 1.0), Figure("third", "none")]
    text = screen("Sentence.", figures, notes, see="report.html")
    first, second = (line.count("█") for line in text.splitlines()[1:3])
    assert first == 2 * second and "third" in text and "most important" in text and "told under" not in text
    assert "see: report.html (more: --verbose)" in text and max(map(len, text.splitlines())) <= 80
    assert "told under" in screen("Sentence.", figures, notes, verbose=True)


def test_a_shell_gets_the_words_that_were_meant():
    odd = "a folder/it's \\ \"new\"\n"
    with outside_allowed():
        text = screen("Sentence.", steps=[command("compare", odd, "--model", None, "-o", "x" * 70)])
    assert text.count("\n") == 2  # broken before options, and by nothing else
    script = "activestereo() { printf '%s\\0' \"$@\"; }\n" + text.partition("next: ")[2]
    words = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True).stdout.split("\0")
    assert words == ["--allow-outside", "compare", odd, "-o", "x" * 70, ""]
