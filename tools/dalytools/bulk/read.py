# SPDX-License-Identifier: GPL-2.0-or-later
"""A capture file to batches of records with typed columns of values (docs/bulk.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalycapture.errors import CaptureError
from dalyref.options import Options
from dalytools.bulk import plain_way
from dalytools.bulk.blocks import CHUNK
from dalytools.bulk.lots import Decoder
from dalytools.bulk.packets import Interfaces
from dalytools.bulk.reading import read_columns
from dalytools.bulk.records import Cutter
from dalytools.bulk.unlike import NotSerialError, OtherMediumError, UnlikeError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from dalytools.bulk.lots import Batch


def read(path: Path | str, options: Options | None = None, *, chunk: int = CHUNK) -> Iterator[Batch]:
    """Yield all records of a capture of serial lines, in the order of the file, with their values.

    What the quick way can not decide is read again from the file's start by the plain decoder, and the batches go on
    where they were. chunk: bytes read at a time. Raises CaptureError (one line) as ``read_capture`` does, after all
    records before the damage; also for packets of another medium, and for standard input (``-``) that would have to be
    read again.
    """
    used = options or Options()
    interfaces = Interfaces()
    cutter, decoder = Cutter(used, interfaces), Decoder(used, interfaces)
    problem: CaptureError | None = None
    given = 0
    try:
        try:
            for packets in read_columns(path, interfaces, chunk=chunk):
                batch = decoder.take(cutter.take(packets))
                given += len(batch.records)
                yield batch
        except CaptureError as error:
            problem = error
        yield decoder.finish(cutter.finish())
    except NotSerialError as error:
        raise OtherMediumError(f"{path}: {error}; read it with: dalyshark decode") from None
    except UnlikeError as error:
        if str(path) == "-":
            message = f"standard input has {error}, and can not be read a second time; give a file"
            raise CaptureError(message) from None
        yield from plain_way.batches(path, used, given, decoder.open_bursts())
        return
    if problem:
        raise problem
