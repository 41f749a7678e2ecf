# SPDX-License-Identifier: Apache-2.0
"""The package itself: what its import loads, and its version."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import activestereo
import kuafu
import simsense
from activestereo.cli import main

CMAKE = (Path(__file__).resolve().parents[3] / "CMakeLists.txt").read_text(encoding="utf-8")


def test_its_import_loads_nothing_but_itself_and_the_standard_library():
    """NumPy, a renderer or a drawing library would take half a second from everyone who only wants a name."""
    program = (
        "import json, sys; before = set(sys.modules); import activestereo; "
        "print(json.dumps(sorted({name.split('.')[0] for name in set(sys.modules) - before})))"
    )
    ran = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    loaded = set(json.loads(ran.stdout))
    assert "activestereo" in loaded
    assert loaded - set(sys.stdlib_module_names) == {"activestereo"}


def test_the_version_is_that_of_the_build_everywhere(capsys):
    version = re.search(r"project\(activestereo VERSION ([0-9.]+)", CMAKE)[1]
    assert activestereo.__version__ == kuafu.__version__ == simsense.__version__ == version
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"activestereo {version}\n"
