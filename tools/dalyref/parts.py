# SPDX-License-Identifier: GPL-2.0-or-later
"""The frames of a burst one by one: what each shows, what is missing, where the whole stands (docs/records.md, 8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalyref import cells, texts
from dalyref.values import put

if TYPE_CHECKING:
    from dalyref.bursts import Burst
    from dalyref.slate import Slate
    from dalyref.streams import Located


def skip(data_id: int, content: bytes, slate: Slate) -> None:
    """Show a frame that is no part of any burst."""
    slate.fields["daly.frame_number"] = content[0]
    if data_id in cells.SLOTS:
        slate.fields["daly.reserved"] = content[1:].hex()
    else:
        slate.fields["daly.text_part"] = texts.shown(content[1:])


def take(burst: Burst[Slate], located: Located, content: bytes, slate: Slate, quiet_ns: int) -> bool:
    """Add a frame to the burst that it begins or continues; tell whether the whole table stands in it.

    quiet_ns: the burst ends after so long. Of a burst that has just begun, `last` is one less than its base or more.
    """
    fields, number, data_id = slate.fields, content[0], burst.data_id
    if burst.settled and not burst.count:
        burst.whole_in = 0  # what was final before stands; the whole is in a later one
    missing = range(burst.last + 1, number)
    if number == burst.last:
        fields["daly.burst.repeat"] = True
    if missing:
        burst.whole = False
        put(fields, "daly.burst.missing", missing)
    burst.last, burst.end_ns = number, located.end_ns
    burst.owner, burst.owner_number = slate, located.packet.number
    burst.open_until_ns = located.end_ns + quiet_ns
    burst.settled = False
    if data_id in cells.SLOTS:
        fields.update(cells.decode(data_id, content, cells.used(data_id, number, burst.base, burst.count)))
        burst.values[number] = cells.cells(content) if data_id == cells.CELLS else tuple(content[1:])
    else:
        fields["daly.frame_number"] = number
        fields["daly.text_part"] = texts.shown(content[1:])
        burst.text[number] = content[1:]
    if burst.whole_in:
        fields["daly.reassembled_in"] = burst.whole_in
    if burst.count and burst.whole and burst.reaches_end(number):
        fields.update(burst.table())
        _link(burst, located.packet.number)
        return True
    if burst.whole_in == 0:
        burst.parts.append(slate)
        slate.burst = burst  # the whole, or that it was cut off, may still be found out
    return False


def _link(burst: Burst[Slate], packet: int) -> None:
    """Tell the records of a burst that came before where the whole of it stands."""
    for part in burst.parts:
        part.fields["daly.reassembled_in"] = packet
        part.close()
    burst.parts.clear()
    burst.whole_in = burst.whole_in or packet


def end(burst: Burst[Slate], *, known: bool = True) -> None:
    """End a burst, as far as it came. known: it is sure that it has ended, the capture does not merely stop."""
    if burst.settled:
        return
    burst.settled = True
    if burst.needs_end:
        whole = burst.table()
        if whole:
            burst.owner.fields.update(whole)
            burst.parts.remove(burst.owner)
            _link(burst, burst.owner_number)
    if known and burst.cut_off:
        burst.owner.fields["daly.burst.cut_off"] = True
    for part in (*burst.parts, burst.owner):
        part.close()
    burst.parts.clear()
