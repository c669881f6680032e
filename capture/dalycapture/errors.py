# SPDX-License-Identifier: GPL-2.0-or-later
"""Errors of capturing: one line each that says what is wrong and what to do."""


class CaptureError(Exception):
    """A port, an output or a capture file can not be used. ``str()`` is one line for people."""


class PortError(CaptureError):
    """The serial port can not be opened or used."""


class TruncatedError(CaptureError):
    """A capture file ends in the middle of a packet or block. All whole packets came before it."""


def reason(error: OSError) -> str:
    """Say what the system said, in lower case: ``no space left on device``."""
    text = error.strerror or str(error)
    return text[:1].lower() + text[1:]
