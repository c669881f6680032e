# SPDX-License-Identifier: GPL-2.0-or-later
"""What the quick way does not read."""

from __future__ import annotations

from dalycapture.errors import CaptureError


class UnlikeError(Exception):
    """A capture has what only the plain decoder decides; said in a few words."""


class OtherMediumError(CaptureError):
    """The same, said to whoever reads a capture in bulk: one line."""


class NotSerialError(UnlikeError):
    """A capture has packets of another medium than a serial line."""
