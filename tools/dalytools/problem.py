# SPDX-License-Identifier: GPL-2.0-or-later
"""The one kind of error that people see."""


class Problem(Exception):  # noqa: N818 - it is what the user has, not what the program did
    """Something the user can act on: one line that says what is wrong and what to do. Exit status 2."""
