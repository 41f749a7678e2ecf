# SPDX-License-Identifier: Apache-2.0
"""Defines the exit status of every command; examples/guide/command_line.md explains them to users."""

FINE = 0
FINDING = 1  # the command did its work and found a fault in its subject
USAGE = 2  # an option or a file is wrong
FAILURE = 3  # the device or the program failed
STOPPED = 130  # from the keyboard: 128 + SIGINT
READER_GONE = 141  # of a pipe: 128 + SIGPIPE
