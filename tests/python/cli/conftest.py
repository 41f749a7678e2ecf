# SPDX-License-Identifier: Apache-2.0
"""Commands run in this process."""

from functools import partial

import pytest
from command_line import run_here


@pytest.fixture
def run(capsys):
    """The command's status and what it wrote."""
    return partial(run_here, capsys)


@pytest.fixture
def ran(run):
    """A command that succeeds: what it wrote."""

    def ran(*words):
        result = run(*words)
        assert result.returncode == 0, result.stderr
        return result

    return ran
