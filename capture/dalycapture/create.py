# SPDX-License-Identifier: GPL-2.0-or-later
"""Make a capture: an output and the writer of its format, together."""

from __future__ import annotations

import os
import platform
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from dalycapture.errors import CaptureError, reason
from dalycapture.output import beside, open_output, open_pipe
from dalycapture.pcap import PcapWriter
from dalycapture.pcapng import PcapngWriter
from dalycapture.rotation import FileSeries, Keeping, Rotation

if TYPE_CHECKING:
    from collections.abc import Generator

    from dalycapture.output import Output
    from dalycapture.writer import CaptureWriter


def open_writer(
    path: Path | str,
    file_format: Literal["pcapng", "pcap"] = "pcapng",
    *,
    application: str = "dalyshark",
    keeping: Keeping | None = None,
    about_machine: bool = True,
) -> CaptureWriter:
    """Make a capture file; ``-`` is standard output. An older capture of that name is overwritten, nothing else is.

    Its header is written with the first interface.
    application: name and version of the program, for the file; keeping: in what form files are kept; about_machine:
    say on what hardware and system it was made. Raises CaptureError.
    """
    keeping = keeping or Keeping()
    output = _output(path, file_format, keeping)
    if file_format == "pcap":
        return PcapWriter(output, wait_when_full=keeping.wait_when_full)
    return PcapngWriter(
        output,
        application=application,
        hardware=platform.machine() if about_machine else "",
        os_name=f"{platform.system()} {platform.release()}" if about_machine else "",
        wait_when_full=keeping.wait_when_full,
    )


@contextmanager
def new_capture(
    path: Path | str, file_format: Literal["pcapng", "pcap"] = "pcapng", *, application: str = "dalyshark"
) -> Generator[CaptureWriter]:
    """Make a capture file that appears whole: written beside its place, renamed when the block ends well.

    ``-`` and what is no regular file are written directly. An older capture of that name is replaced, nothing else is.
    Raises CaptureError.
    """
    place = Path(os.path.realpath(path))
    if str(path) == "-" or (place.exists() and not place.is_file()):
        with open_writer(path, file_format, application=application) as writer:
            yield writer
        return
    new = beside(place)
    try:
        with open_writer(new, file_format, application=application) as writer:
            yield writer
        new.replace(place)
    except OSError as error:
        raise CaptureError(f"{path} can not be written: {reason(error)}") from None
    finally:
        new.unlink(missing_ok=True)


def _output(path: Path | str, file_format: str, keeping: Keeping) -> Output:
    direct = open_output(path) if str(path) == "-" else open_pipe(path)
    if direct is None:
        return FileSeries(Path(path), keeping, file_format)
    if keeping.append or keeping.checksum or keeping.rotation != Rotation():
        raise CaptureError(f"{direct.name} is no file: --append, --sha256 and -b have no meaning for it")
    return direct
