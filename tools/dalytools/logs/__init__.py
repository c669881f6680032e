# SPDX-License-Identifier: GPL-2.0-or-later
"""Text and binary logs of other tools, read for the bytes, times and directions in them: one kind of log a module."""
