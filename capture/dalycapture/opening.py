# SPDX-License-Identifier: GPL-2.0-or-later
"""Which kind of port a name means: a device of this machine, or a network's."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from dalycapture.settings import DEFAULT_BAUD, Settings

if TYPE_CHECKING:
    from dalycapture.line import Line
    from dalycapture.port import Port


def open_port(name: str, settings: Settings | int = DEFAULT_BAUD, *, line: Line | None = None) -> Port:
    """Open a device (``/dev/ttyUSB0``), or a ``socket://`` or ``rfc2217://`` URL, to listen.

    settings: or only the baud rate. line: answers for the driver (tests). Raises PortError, one line: not there, no
    permission, in use, not a serial device, baud rate not possible.
    """
    if isinstance(settings, int):
        settings = Settings(settings)
    if "://" in name or os.name == "nt":
        from dalycapture.remote import open_remote  # pyserial's network parts, not for a device

        return open_remote(name, settings)
    from dalycapture.device import open_device

    return open_device(name, settings, line)
