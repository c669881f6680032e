# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes that belong to no good frame: blanked, but for what says that they are damaged, and how.

bad_checksum   A5 addr id 08 | eight bytes, blanked | a sum that is as wrong as it was (of texts: by 1)
short          the head of the frame that it began; the rest blanked
junk           blanked; 00 and FF stay
foreign        the frames of other protocols keep their shape, and their check bytes are made right again
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Final

from dalyref import a5, bluetooth_module, foreign, modbus
from dalyref.kinds import Kind
from dalytools.redact import a5_layout, modbus_data
from dalytools.redact.what import DATES, TEXTS, What

if TYPE_CHECKING:
    from dalyref.kinds import Record
    from dalytools.redact.blanker import Blanker

_Step = Callable[[bytes, int, int], int]
_One = Callable[[bytes, "Blanker"], bytes]
_HEAD: Final = 4
_SINOWEALTH_HEAD: Final = 3
_MODBUS_HEADS: Final = {modbus.READ: 3, modbus.WRITE_ONE: 4, modbus.WRITE_MANY: 7}
"""Address, function, and what says how long the frame would be."""


def bad_checksum(data: bytes, blanker: Blanker) -> bytes:
    """Blank the 13 bytes of an A5 frame whose sum is wrong."""
    content = _a5_content(data, blanker)
    if content == data[_HEAD : a5.SIZE - 1]:
        return data
    # Over a text the sum, or its difference to one, would tell of it.
    wrong_by = 1 if _is_secret(data[2]) else data[-1] - a5.checksum(data[:-1])
    head = data[:_HEAD] + content
    return head + bytes(((a5.checksum(head) + wrong_by) & 0xFF,))


def short(data: bytes, blanker: Blanker) -> bytes:
    """Blank a beginning."""
    if data[0] == a5.START:
        return data[:_HEAD] + _a5_content(data, blanker)
    head = _MODBUS_HEADS.get(data[1], 2)
    return data[:head] + blanker.whole(data[head:], What.DAMAGED, "cut-off frames")


def _a5_content(data: bytes, blanker: Blanker) -> bytes:
    """Blank what stands behind the head of a damaged A5 frame, up to its sum."""
    content = data[_HEAD : _HEAD + a5_layout.SIZE]
    where = "frames with a wrong checksum" if len(data) == a5.SIZE else "cut-off frames"
    if _is_secret(data[2]):
        return blanker.spans(content, [(0, len(content) - 1, What.STALE)], where)
    return blanker.whole(content, What.DAMAGED, where)


def _is_secret(data_id: int) -> bool:
    """Tell whether frames of an ID carry texts or dates."""
    spans = a5_layout.request(data_id) or a5_layout.reply(data_id)
    return any(span.what in TEXTS or span.what in DATES for span in spans)


def junk(data: bytes, blanker: Blanker) -> bytes:
    """Blank bytes without any shape."""
    return blanker.whole(data, What.DAMAGED, "junk")


def others(record: Record, blanker: Blanker) -> bytes:
    """Blank what frames of other protocols carry."""
    if record.foreign in _FRAMES:
        step, one = _FRAMES[record.foreign]
        out, at, data = b"", 0, record.data
        while at < len(data):
            stop = step(data, at, len(data))
            out += one(data[at:stop], blanker)
            at = stop
        return out
    if bluetooth_module.is_text(record.data):
        return _module_text(record.data, blanker)
    return modbus_data.blank(record.data, None, blanker)


def _module_text(data: bytes, blanker: Blanker) -> bytes:
    """Blank what the Bluetooth module says behind its first word: its name, its address, its versions."""
    first = re.match(rb"AT(\+[A-Z]*)?|\+[A-Z]*|OK|ERROR|HiLink", data)
    head = first.end() if first else 0
    letters = re.sub(rb"[0-9A-Za-z]", b"X", data[head:])
    return data[:head] + blanker.given(data[head:], letters, What.FOREIGN, "text of the Bluetooth module")


def _modbus(frame: bytes, blanker: Blanker) -> bytes:
    head = _foreign_head(frame)
    content = blanker.whole(frame[head:-2], What.FOREIGN, foreign.MODBUS)
    return frame if content == frame[head:-2] else modbus_data.with_crc(frame[:head] + content)


def _foreign_head(frame: bytes) -> int:
    """Return how many bytes of a frame say what it is: address, function, registers, count."""
    function, size = frame[1], len(frame)
    if function in (0x05, 0x06):
        return 4
    if function in (0x0F, 0x10) and size > 8:
        return 7
    if function <= 0x04 and (size != 8 or frame[2] == 3):  # a reply; one of three bytes is as long as a request
        return 3
    return size - 2


def _sinowealth(exchange: bytes, blanker: Blanker) -> bytes:
    if len(exchange) <= _SINOWEALTH_HEAD:
        return exchange
    content = blanker.whole(exchange[_SINOWEALTH_HEAD:-1], What.FOREIGN, foreign.SINOWEALTH)
    body = exchange[:_SINOWEALTH_HEAD] + content
    return body + bytes((foreign.crc8(body),))


def _pylontech(frame: bytes, blanker: Blanker) -> bytes:
    head, digits = frame[: foreign.PYLONTECH_HEAD], frame[foreign.PYLONTECH_HEAD : -5]
    body = head + blanker.given(digits, b"0" * len(digits), What.FOREIGN, foreign.PYLONTECH)
    return body + b"%04X\r" % foreign.complement(body[1:])


def _jbd(frame: bytes, blanker: Blanker) -> bytes:
    head = frame[: foreign.JBD_HEAD]
    body = head + blanker.whole(frame[foreign.JBD_HEAD : -3], What.FOREIGN, foreign.JBD)
    return body + foreign.complement(body[2:]).to_bytes(2) + frame[-1:]


_FRAMES: Final[dict[str, tuple[_Step, _One]]] = {
    foreign.MODBUS: (foreign.modbus_step, _modbus),
    foreign.SINOWEALTH: (partial(foreign.sinowealth_step, ended=True), _sinowealth),
    foreign.PYLONTECH: (foreign.pylontech_step, _pylontech),
    foreign.JBD: (foreign.jbd_step, _jbd),
}
"""Of each maker: where the frame at a place ends, and what stands in the copy for it."""


def blank(record: Record, blanker: Blanker) -> bytes:
    """Blank a record that is no frame."""
    if record.kind is Kind.BAD_CHECKSUM:
        return bad_checksum(record.data, blanker)
    if record.kind is Kind.SHORT:
        return short(record.data, blanker)
    if record.kind is Kind.FOREIGN:
        return others(record, blanker)
    return junk(record.data, blanker)
