# SPDX-License-Identifier: GPL-2.0-or-later
"""What people run on captures: the ``dalyshark`` command and what stands behind it."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("dalyshark")
except PackageNotFoundError:  # run from a bare checkout
    __version__ = "0"
