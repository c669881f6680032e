# SPDX-License-Identifier: GPL-2.0-or-later
"""A checksum file beside a closed capture: ``x.pcapng.sha256``, for ``sha256sum -c x.pcapng.sha256`` in its folder.

It is there only when the capture is closed and whole. The sum is of what was given to the disk, counted along, not of
what is read back: if the disk, or somebody, changed a byte meanwhile, the check fails.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

SUFFIX = ".sha256"


def checksum_path(capture: Path) -> Path:
    """Return where the checksum of a capture is."""
    return capture.with_name(capture.name + SUFFIX)


def checksum_line(name: str, digest: str) -> bytes:
    r"""Lay out the line as GNU coreutils do: a name with a backslash or a line end is escaped, a backslash in front."""
    escaped = name.replace("\\", "\\\\").replace("\n", "\\n").replace("\r", "\\r")
    mark = "\\" if escaped != name else ""
    return os.fsencode(f"{mark}{digest}  {escaped}\n")


def write_checksum(capture: Path, digest: str) -> None:
    """Write the checksum file, beside its place, then renamed. Raises OSError."""
    path = checksum_path(capture)
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with beside.open("wb") as out:
            out.write(checksum_line(capture.name, digest))
            out.flush()
            os.fsync(out.fileno())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
