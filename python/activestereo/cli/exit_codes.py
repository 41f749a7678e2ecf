# SPDX-License-Identifier: Apache-2.0
"""The exit status of every command; examples/guide/command_line.md has the table for users."""

FINE = 0
FINDING = 1  # the command did its work, and what it looked at is not in order
USAGE = 2  # an option or a file is wrong
FAILURE = 3  # the device or the program failed
STOPPED = 130  # from the keyboard: 128 + SIGINT
READER_GONE = 141  # of a pipe: 128 + SIGPIPE
