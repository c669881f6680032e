# SPDX-License-Identifier: GPL-2.0-or-later
"""The plain decoder's fields that the columns leave out (docs/bulk.md)."""

from __future__ import annotations

from typing import Final

LEFT_OUT: Final = frozenset(
    (
        # What is said of exchanges, of bursts, and of what changed or contradicts.
        "daly.request_in",
        "daly.reply_in",
        "daly.response_time",
        "daly.retry",
        "daly.unanswered",
        "daly.unasked",
        "daly.late_to",
        "daly.other_board",
        "daly.second_host",
        "daly.write_result",
        "daly.reassembled_in",
        "daly.burst.missing",
        "daly.burst.repeat",
        "daly.burst.cut_off",
        "daly.changed",
        "daly.changed_from",
        "daly.fault_raised",
        "daly.fault_cleared",
        "daly.contradiction",
        "daly.contradicts",
        # What stands in the record's bytes, or in another column.
        "daly.kind",
        "daly.transport",
        "daly.dialect",
        "daly.start",
        "daly.address",
        "daly.data_id",
        "daly.unknown_id",
        "daly.length",
        "daly.data",
        "daly.checksum",
        "daly.checksum.status",
        "daly.write",
        "daly.reserved",
        "daly.undecoded",
        "daly.foreign",
        "daly.text_part",
        "daly.balance.cell",
        "daly.modbus.address",
        "daly.modbus.function",
        "daly.modbus.crc",
        "daly.modbus.crc.status",
        *(f"daly.cell.{number:02d}" for number in range(1, 49)),
    )
)
