# SPDX-License-Identifier: Apache-2.0
"""Puts the licence's line at the top of every source file; `--check` changes nothing and names the files that lack it.

    python3 tests/licence_lines.py [--check]
"""

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LINE = "SPDX-License-Identifier: Apache-2.0"
HASH = (".py", ".pyi", ".pyi.in", ".sh", ".cmake", ".cmake.in", ".pc.in", ".sh.in", ".toml", ".rules")
SLASHES = (".h", ".hpp", ".cpp", ".inc", ".glsl", ".comp", ".rgen", ".rchit", ".rmiss", ".js", ".rs")
BLOCK = (".c", ".css")
NAMED = {"CMakeLists.txt", ".ci/run"}
# Kept as they were: headers that callers of a release were compiled with, and inputs that once broke something.
AS_THEY_ARE = ("tests/capi/baseline/", "tests/fuzz/corpus/")


def comment(path: str) -> str | None:
    """The line as a comment of the file's language; None where the file is no source."""
    name = path.rsplit("/", 1)[-1]
    if path.startswith(AS_THEY_ARE):
        return None
    if name in NAMED or path in NAMED or path.endswith(HASH):
        return f"# {LINE}\n"
    if path.endswith(BLOCK) or (path.startswith("capi/include/") and path.endswith(".h")):
        return f"/* {LINE} */\n"
    if path.endswith(SLASHES):
        return f"// {LINE}\n"
    return f"<!-- {LINE} -->\n" if path.endswith(".html") else None


def licensed(path: str, text: str) -> str:
    """The text with the line at its top, below a first line that an interpreter or a browser reads."""
    line = comment(path)
    if line is None or line in text[:400]:
        return text
    first, rest = text.split("\n", 1) if "\n" in text else (text, "")
    if first.startswith(("#!", "<!doctype", "<!DOCTYPE")):
        return f"{first}\n{line}{rest}"
    return line + text


def sources() -> list[str]:
    """Paths of the tracked files that carry the line."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    return [path for path in listed if comment(path) is not None and (ROOT / path).is_file()]


def main() -> int:
    """0: every source has the line. 1: one lacks it, or did."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--check", action="store_true", help="change nothing; name the files that lack the line and fail"
    )
    check = parser.parse_args().check
    lacking = []
    for path in sources():
        text = (ROOT / path).read_text(encoding="utf-8")
        whole = licensed(path, text)
        if whole == text:
            continue
        lacking.append(path)
        if not check:
            (ROOT / path).write_text(whole, encoding="utf-8")
    for path in lacking:
        print(f"{path} lacks its licence line: run python3 tests/licence_lines.py" if check else f"written: {path}")
    return 1 if check and lacking else 0


if __name__ == "__main__":
    sys.exit(main())
