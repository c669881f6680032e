# SPDX-License-Identifier: GPL-2.0-or-later
"""The log of nRF Connect for Mobile, as it exports it.

    nRF Connect, 2026-08-26
    I	19:33:31.001	Data written to 0000fff2-0000-1000-8000-00805f9b34fb, value: (0x) D2-03-00-00-00-3E-D7-B9
    I	19:33:31.152	Notification received from 0000fff1-0000-1000-8000-00805f9b34fb, value: (0x) D2-03-7C-..

and on iOS, as text or as a table:

    19:33:31.152	Updated Value of Characteristic FFF1 to 0xD2037C..
    [19:33:31.0010] Debug: peripheral.writeValue(0xD2030000003ED7B9, for: FFF2, type: .withoutResponse)
    [19:33:31.1520] Normal: Updated Value of Characteristic FFF1 to D203 7C..
    19:33:31.1520,DL-D11A04015994,Normal,Updated Value of Characteristic FFF1 to D203 7C..

The date stands in the first line. Values of other characteristics (battery level, device name) are known and left out,
as are the callbacks that tell the same bytes again. Sources: patman15/BMS_BLE-HA 806, nordicsemi/IOS-nRF-Connect 174,
and other public logs of the app; that it tells writes as Nordic's other programs for iOS do is a guess.
"""

from __future__ import annotations

import re
from dataclasses import replace

from dalytools.logs.entry import DAY_NS, IN, OUT, Entry, PlainLineLog
from dalytools.logs.hexbytes import hex_bytes
from dalytools.logs.stamps import split_stamp

_HEAD = re.compile(r"\s*nRF Connect(?: for Mobile)?,? *(\d{4}-\d\d-\d\d)?.{0,60}", re.IGNORECASE)
_LEVEL = re.compile(r"\s*[ADVIWE][\t ]+")
_VALUE = re.compile(
    r"(?:\"|\[Callback\] )?(?P<what>Data written to|Notification received from|Indication received from)"
    r" (?P<uuid>[0-9A-Fa-f-]{4,36}),? value: \(0x\) (?P<hex>[0-9A-Fa-f-]+).{0,100}"
)
_IOS = re.compile(r"Updated Value of Characteristic (?P<uuid>[0-9A-Fa-f-]{4,36}) to (?:0x)?(?P<hex>[0-9A-Fa-f ]+)\.?")
_IOS_WRITE = re.compile(
    r"peripheral\.writeValue\((?:0x)?(?P<hex>[0-9A-Fa-f ]+), for: (?P<uuid>[0-9A-Fa-f-]{4,36}), type: .{1,40}"
)
_IOS_LEVEL = re.compile(
    r"(?P<table>,?[^,:]{0,60},)?(?:Verbose|Debug|Normal|Info|Application|Warning|Error)(?(table),|:)[ \"]*"
)
_OURS = {"fff1", "fff2", "ff01", "ff02"}


class NrfConnect(PlainLineLog):
    """A log of nRF Connect."""

    name = "nrfconnect"
    about = "nRF Connect's log: Notification received from 0000fff1-.., value: (0x) A5-01-.."

    def __init__(self) -> None:
        self._day_ns = 0
        self._clock_ns = 0  # the newest time of day
        self._headed = False

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        head = _HEAD.fullmatch(line)
        if head:
            self._headed = True
            stamp, _ = split_stamp(f"{head[1]} 00:00:00") if head[1] else (None, "")
            self._day_ns, self._clock_ns = stamp.ns if stamp else 0, 0
            return []
        level = _LEVEL.match(line)
        stamp, rest = split_stamp(line[level.end() :] if level else line)
        if stamp is not None and stamp.what == "day" and self._day_ns:
            if stamp.ns < self._clock_ns - DAY_NS // 2:  # past midnight
                self._day_ns += DAY_NS
            self._clock_ns = stamp.ns
            stamp = replace(stamp, what="moment", ns=self._day_ns + stamp.ns)
        if stamp is not None and (ios := _IOS_LEVEL.match(rest)):
            level, rest = ios, rest[ios.end() :].rstrip('" ')
            self._headed = True
        text = rest.strip()
        found = _VALUE.fullmatch(text) or _IOS.fullmatch(text) or _IOS_WRITE.fullmatch(text)
        if found:
            data = hex_bytes(found["hex"])
            uuid = found["uuid"].lower()
            short = uuid[4:8] if len(uuid) == 36 else uuid
            if data is None:
                return None
            if short not in _OURS:
                return []
            out = found.re is _IOS_WRITE or (found.re is _VALUE and found["what"].startswith("Data written"))
            return [Entry(data, stamp, OUT if out else IN)]
        known = self._headed and (level is not None or stamp is not None or line.startswith((" ", "-", "\t", "DL-")))
        return [] if known or (self._headed and re.match(r"[\w ]{3,60}\(", line)) else None
