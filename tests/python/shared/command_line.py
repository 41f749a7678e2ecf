# SPDX-License-Identifier: Apache-2.0
"""The commands of the command line, as the parser has them."""

import argparse

from activestereo.cli import make_parser


def leaves(parser=None):
    """{"calibrate noise": its parser} of all commands that do something."""
    parser = make_parser() if parser is None else parser
    kinds = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    inner = [leaf for kind in kinds for each in kind.choices.values() for leaf in leaves(each).items()]
    return dict(inner) if kinds else {parser.prog.partition(" ")[2]: parser}
