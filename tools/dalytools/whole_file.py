# SPDX-License-Identifier: GPL-2.0-or-later
"""A file that appears whole or not at all: written beside its place, then renamed."""

from __future__ import annotations

import os
import stat
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, TextIO

from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Generator


@contextmanager
def whole_file(path: str) -> Generator[TextIO]:
    """Open `path` for writing text; it takes its name when the block ends well, and is gone when it does not.

    What is no regular file (a pipe, a device) is written directly. Raises Problem where it cannot be written.
    """
    with whole_binary_file(path) as raw:
        out = TextIOWrapper(raw, encoding="utf-8", write_through=False)
        try:
            yield out
            out.flush()
        finally:
            with suppress(OSError, ValueError):  # told by the flush
                out.detach()


@contextmanager
def whole_binary_file(path: str) -> Generator[BinaryIO]:
    """Open `path` for writing bytes, in the same way."""
    place = Path(os.path.realpath(path))
    beside = place.parent / f".{place.name}.{os.getpid()}.part"
    try:
        mode = place.stat().st_mode if place.exists() else stat.S_IFREG
        if stat.S_ISDIR(mode):
            raise Problem(f"{path} is a directory; name a file in it")
        direct = not stat.S_ISREG(mode)
        out = place.open("wb") if direct else beside.open("xb")
    except OSError as error:
        raise Problem(f"{path}: cannot be written: {error.strerror}; name another file") from None
    try:
        try:
            yield out
            out.flush()
        finally:
            with suppress(OSError):  # told by the flush
                out.close()
        if not direct:
            beside.replace(place)
    except BaseException as error:
        if not direct:
            beside.unlink(missing_ok=True)
        if isinstance(error, OSError) and not isinstance(error, BrokenPipeError):
            raise Problem(f"{path}: cannot be written: {error.strerror}") from None
        raise
