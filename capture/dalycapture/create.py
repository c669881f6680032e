# SPDX-License-Identifier: GPL-2.0-or-later
"""Make a capture: an output and the writer of its format, together."""

from __future__ import annotations

import platform
from typing import TYPE_CHECKING, Literal

from dalycapture.output import open_output
from dalycapture.pcap import PcapWriter
from dalycapture.pcapng import PcapngWriter

if TYPE_CHECKING:
    from pathlib import Path

    from dalycapture.writer import CaptureWriter


def open_writer(
    path: Path | str, file_format: Literal["pcapng", "pcap"] = "pcapng", *, application: str = "dalyshark"
) -> CaptureWriter:
    """Make a capture file; ``-`` is standard output. An older capture of that name is overwritten, nothing else is.

    Its header is written with the first interface.
    application: name and version of the program, for the file. Raises CaptureError.
    """
    output = open_output(path)
    if file_format == "pcap":
        return PcapWriter(output)
    system = f"{platform.system()} {platform.release()}"
    return PcapngWriter(output, application=application, hardware=platform.machine(), os_name=system)
