# SPDX-License-Identifier: Apache-2.0
"""Converts recordings of other programs to captures (capture format, version 1), each by a file that says which. frames
has what they share: camera poses as a TUM text file, repeats of views, and frames as captures.

Every failure of the input is a ValueError of one line: the file, the key and the value."""
