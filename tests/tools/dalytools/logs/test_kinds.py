# SPDX-License-Identifier: GPL-2.0-or-later
"""Each kind of log: made by hand after the shape in the module's docstring, guessed, and read to bytes and times.

The frames are real ones (``tano-req-90``, ``tano-90-1`` of real-frames.jsonl) and the article's Modbus example.
"""

from __future__ import annotations

import io

import pytest

from dalycapture.captured import Told
from dalyref.options import Options
from dalytools.logs.importer import Importer
from dalytools.logs.kinds import KINDS, guess
from dalytools.logs.serialbattery import on_the_wire
from dalytools.logs.text_lines import is_text, text_lines

ASK = bytes.fromhex("a540900800000000000000007d")
ANSWER = bytes.fromhex("a501900802100000753001f4ea")
HOUR, SECOND, MS = 3600 * 10**9, 10**9, 10**6
LENGTH = 13_541_667  # ns of a frame: 13 x 10 / 9600 s


def spaced(data: bytes, mark: str = " ") -> str:
    return mark.join(f"{byte:02X}" for byte in data)


def read(text: str, **options: float) -> tuple[str, list[tuple[int, str, bytes]], Importer]:
    """Return the kind guessed, and (ns, direction, bytes) of each packet with bytes."""
    lines = [line for line in text_lines(io.BytesIO(text.encode())) if line.strip()]
    found = guess(lines)
    assert found is not None
    importer = Importer("log", found.name, Options(), Told(), samplerate=options.get("samplerate", 0.0))
    packets = [packet for packet in importer.packets(io.BytesIO(text.encode())) if packet.data]
    return found.name, [(packet.time_ns, packet.direction, packet.data) for packet in packets], importer


def test_the_frames_are_good() -> None:
    for data in (ASK, ANSWER):
        assert sum(data[:12]) & 0xFF == data[12]


@pytest.mark.parametrize(
    "text",
    [
        f"{spaced(ASK)}\n{spaced(ANSWER)}\n",
        f"{ASK.hex()}\r\n{ANSWER.hex().upper()}\r\n",
        f"{spaced(ASK, ':')}\n{spaced(ANSWER, ', ')}\n",
        f"# pasted\n0x{spaced(ASK, ' 0x')}\n0x{spaced(ANSWER, ', 0x')},\n",
        f"{ASK!r}\nbytearray({ANSWER!r})\n",
        f"{spaced(ASK).replace('00', '0')}\n{spaced(ANSWER).replace('00', '0').replace('01', '1')}\n",
    ],
)
def test_hex_lines_without_times(text: str) -> None:
    kind, packets, importer = read(text)
    assert kind == "hex"
    assert [data for *_, data in packets] == [ASK, ANSWER]
    assert packets[1][0] - packets[0][0] == LENGTH + 120 * MS  # a gap between messages, in which no echo is seen
    assert importer.tally.timed == importer.tally.not_understood == 0


def test_hex_lines_with_times_and_directions() -> None:
    text = (
        f"[12:34:56.789] TX: {spaced(ASK)}\n[12:34:56.840] RX: {spaced(ANSWER)}\n"
        f"2026-11-21T12:34:56.789Z -> {ASK.hex()}\n"
        f"2026-11-21 13:34:56,789 +01:00 <- {ANSWER.hex()}\n"
        f"1700000000.25 Received: {spaced(ANSWER, ':')}\n"
        f"@4000000067d832cd1c5c2c4c {spaced(ASK)}\n"
        "what is this?\n"
    )
    kind, packets, importer = read(text)
    assert kind == "hex"
    clock = 12 * HOUR + 34 * 60 * SECOND + 56 * SECOND
    day = 20778 * 24 * HOUR  # 2026-11-21
    assert packets[:5] == [
        (clock + 789 * MS, "outbound", ASK),
        (clock + 840 * MS, "inbound", ANSWER),
        (day + clock + 789 * MS, "outbound", ASK),
        (day + clock + 789 * MS + LENGTH, "inbound", ANSWER),  # the same millisecond: moved behind the other
        (1700000000 * SECOND + 250 * MS, "inbound", ANSWER),
    ]
    assert packets[5][0] == (0x67D832CD - 10) * SECOND + 0x1C5C2C4C
    assert (importer.tally.not_understood, importer.tally.moved) == (1, 1)


def test_times_of_day_go_on_behind_midnight() -> None:
    _, packets, importer = read(f"23:59:59.900 {spaced(ASK)}\n00:00:00.100 {spaced(ANSWER)}\n")
    assert packets[1][0] - packets[0][0] == 200 * MS
    assert importer.tally.day_unknown


@pytest.mark.parametrize(
    ("first", "second", "apart"),
    [
        ("12:34:56 ", "12:34:57 ", SECOND),
        ("12:34:56: ", "12:34:57: ", SECOND),
        ("12:34:56,78 ", "12:34:56,83 ", 50 * MS),
        ("12:34:56:780 ", "12:34:56:830 ", 50 * MS),
        ("2026-11-21 12:34:56 ", "2026-11-21 12:34:57 ", SECOND),
        ("20261121123456 ", "20261121T123457.25,", 1250 * MS),
        ("1700000000 ", "1700000001 ", SECOND),
        ("1700000000123 ", "1700000000173 ", 50 * MS),
        ("1700000000123456 ", "1700000000173456 ", 50 * MS),
        ("1700000000123456789 ", "1700000000173456789 ", 50 * MS),
        ("Nov 21 12:34:56 rack client[7]: TX: ", "Nov 21 12:34:57 rack client[7]: RX: ", SECOND),
        ('"2026-11-21 12:34:56.10";"TX";"', '"2026-11-21 12:34:56.15";"RX";"', 50 * MS),
        ("2026-11-21 12:34:56.10 - bms - DEBUG - Sent 13 bytes: ", "2026-11-21 12:34:56.15 - bms - RX: ", 50 * MS),
        ("12:34:56\n", "12:34:57\n", SECOND),
        ("+0.250 TX ", "+0.300 RX ", 50 * MS),
        ("250.5 ms TX ", "300.5 ms RX ", 50 * MS),
        ("2026-11-21 12:34:56.100:\n", "2026-11-21 12:34:56.150:\n", 50 * MS),
    ],
)
def test_times_are_no_bytes(first: str, second: str, apart: int) -> None:
    """Digits, colons and dashes could be bytes too: 12:34:56 was taken for 12 34 56."""
    kind, packets, importer = read(f"{first}{spaced(ASK)}\n{second}{spaced(ANSWER)}\n")
    assert kind == "hex"
    assert [data for *_, data in packets] == [ASK, ANSWER]
    assert packets[1][0] - packets[0][0] == apart
    assert importer.tally.not_understood == 0


@pytest.mark.parametrize("text", ["12:34:56:A5:40\n01:02:03\n", "1234567890 1234567890\n", "20 26 11 21 12 34 56\n"])
def test_bytes_are_no_times(text: str) -> None:
    _, packets, importer = read(text)
    assert b"".join(data for *_, data in packets).hex() == "".join(c for c in text.lower() if c.isalnum())
    assert importer.tally.timed == 0


@pytest.mark.parametrize(
    ("out", "back"), [("-->", "<--"), ("--->", "<---"), (">>", "<<"), ("TX", "RX"), ("bms write:", "bms read:")]
)
def test_directions(out: str, back: str) -> None:
    """``-->`` was taken for a comment, and its bytes were left out."""
    _, packets, importer = read(f"{out} {spaced(ASK)}\n{back} {spaced(ANSWER)}\n-- the end\n")
    assert [(way, data) for _, way, data in packets] == [("outbound", ASK), ("inbound", ANSWER)]
    assert importer.tally.not_understood == 0


def test_the_arrow_of_arduinos_monitor_is_no_direction() -> None:
    _, packets, _ = read(f"12:34:56.789 -> {spaced(ASK)}\n12:34:56.840 -> {spaced(ANSWER)}\n")
    assert [(way, data) for _, way, data in packets] == [("", ASK), ("", ANSWER)]
    _, packets, _ = read(f"12:34:56.789 -> {spaced(ASK)}\n12:34:56.840 <- {spaced(ANSWER)}\n")
    assert [way for _, way, _ in packets] == ["outbound", "inbound"]


def test_bytes_in_decimal() -> None:
    for mark, ends in (", ", "[]"), (" ", ("", "")), (",", "{}"):
        lines = [mark.join(map(str, data)).join(ends) for data in (ASK[:8], ASK[8:], ANSWER)]
        _, packets, importer = read("\n".join(lines))
        assert [data for *_, data in packets] == [ASK[:8], ASK[8:], ANSWER]
        assert importer.tally.not_understood == 0


def test_bytes_beside_their_letters_and_in_brackets() -> None:
    shown = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in ANSWER)
    for text in (
        f"{spaced(ANSWER)}   {shown}\n",
        f"{spaced(ANSWER[:8])}  {spaced(ANSWER[8:])}  |{shown}|\n",
        f"[{spaced(ANSWER)}]\n",
        f"RX: <Buffer {ANSWER.hex(' ')}>\n",
        f"[12:34:56.789] Rx <- {spaced(ANSWER)} (13)\n",
        f"RX: {' '.join(f'{byte:02X}h' for byte in ANSWER)} [13]\n",
        f"{{{spaced(ANSWER, '}{')}}}\n",
        "".join(f"[{byte:02x}]" for byte in ANSWER),
    ):
        _, packets, importer = read(text)
        assert b"".join(data for *_, data in packets) == ANSWER
        assert importer.tally.not_understood == 0
    _, packets, importer = read(f"{spaced(ANSWER)}\n{spaced(ANSWER)} volts ok\n")
    assert (len(packets), importer.tally.not_understood) == (1, 1)


def test_colours_and_control_characters() -> None:
    text = f"\x1b[0;32m12:34:56.100 TX {spaced(ASK)}\x1b[0m\n\x07\n" + f"12:34:56.150 RX {spaced(ANSWER)}\n" * 20
    kind, packets, importer = read(text)
    assert (kind, len(packets), importer.tally.not_understood) == ("hex", 21, 1)
    assert is_text(text.encode())
    assert is_text(text.encode("utf-16-le"))
    assert [*text_lines(io.BytesIO(), text.encode("utf-16-be"))][1] == "\x07"
    assert not is_text(ASK + ANSWER)


def test_candump() -> None:
    line = "  can0  18904001   [8]  02 10 00 00 75 30 01 F4"
    frame = "9890400108000000" + "021000007530" + "01f4"
    for text, times in (
        (f" (1767225600.051248){line}\n (1767225600.151248){line}\n", [1767225600051248000, 1767225600151248000]),
        (f" (2026-01-01 00:00:00.051248){line}\n", [1767225600051248000]),
        (f" (000.000000){line}\n (000.500000){line}\n (000.600000){line}\n", [0, 500 * MS, 600 * MS]),
        (f" (000.000000){line}\n (000.500000){line}\n (000.250000){line}\n", [0, 500 * MS, 750 * MS]),
        (" (0.5)  can0  RX - -  18904001   [8]  02 10 00 00 75 30 01 F4   '....u0..'\n", [500 * MS]),
        ("(1767225600.051248) can0 18904001#02100000753001F4 R\n", [1767225600051248000]),
    ):
        kind, packets, importer = read(text)
        assert kind == "candump"
        assert [(time, data.hex()) for time, _, data in packets] == [(time, frame) for time in times]
        assert importer.tally.not_understood == 0
    _, packets, importer = read(f"{line}\n  can0  123   [0]\n  can0  00000123   [0]  remote request\n{line[:-3]}\n")
    assert [data.hex() for *_, data in packets] == [frame, "0000012300000000", "c000012300000000"]
    assert importer.tally.not_understood == 1


def test_docklight() -> None:
    text = (
        "Docklight Log File (HEX) - started 24.11.2026 10:00:00.00\n\n"
        f"24.11.2026 10:00:01.12 [TX] - {spaced(ASK[:8])} \n{spaced(ASK[8:])} \n"
        f"24.11.2026 10:00:01.18 [RX] - {spaced(ANSWER)} \n"
    )
    kind, packets, importer = read(text)
    start = 20781 * 24 * HOUR + 10 * HOUR + SECOND  # 2026-11-24
    assert kind == "docklight"
    assert packets[0] == (start + 120 * MS, "outbound", ASK[:8])
    assert packets[1][1:] == ("outbound", ASK[8:])
    assert packets[1][0] - packets[0][0] == 8 * 10 * 10**9 // 9600
    assert packets[2] == (start + 180 * MS, "inbound", ANSWER)
    assert importer.tally.not_understood == 0
    _, packets, _ = read(f"[TX] - 10:00:01 - {spaced(ASK)}\n[RX] - 10:00:02 - {spaced(ANSWER)}\n")  # qModMaster's
    assert packets == [(10 * HOUR + SECOND, "outbound", ASK), (10 * HOUR + 2 * SECOND, "inbound", ANSWER)]


def test_com_tools() -> None:
    sscom = f"[15:37:11.116]发→◇{spaced(ASK)} □\n[15:37:11.165]收←◆{spaced(ANSWER)}\n"
    assist = f"[2025-08-12 22:08:26.776]# SEND HEX>\n{spaced(ASK)} \n\n"
    assist += f"[2025-08-12 22:08:26.830]# RECV HEX>\n{spaced(ANSWER)}\n"
    for text in (sscom, assist):
        kind, packets, importer = read(text)
        assert kind == "comtool"
        assert [(way, data) for _, way, data in packets] == [("outbound", ASK), ("inbound", ANSWER)]
        assert packets[1][0] - packets[0][0] in {49 * MS, 54 * MS}
        assert importer.tally.not_understood == 0
    assert [*text_lines(io.BytesIO(sscom.encode("gb18030")))] == sscom.splitlines()
    assert [*text_lines(io.BytesIO(sscom.encode("utf-16"))), ""][:2] != []


def test_utf_16() -> None:
    data = sscom = f"[15:37:11.116]发→◇{spaced(ASK)}\r\n"
    encoded = data.encode("utf-16")
    assert list(text_lines(io.BytesIO(encoded[9:]), encoded[:9])) == [sscom.strip()]


def test_esphome() -> None:
    text = (
        "INFO Successfully connected to bms.local\n"
        f"[21:57:14][D][uart_debug:114]: >>> {spaced(ASK, ':')}\n"
        f"\x1b[0;36m[21:57:14][D][uart_debug:114]: <<< {spaced(ANSWER, ',')}\x1b[0m\n"
        "[21:57:14][D][sensor:094]: 'Voltage': Sending state 52.80000 V with 1 decimals of accuracy\n"
        f"[21:57:15.500][D][uart_debug:113]: [UART] <<< {spaced(ANSWER)}\n"
        '[21:57:16][D][uart_debug:158]: <<< "\\xA5\\x01"\n'
    )
    kind, packets, importer = read(text)
    at = 21 * HOUR + 57 * 60 * SECOND + 14 * SECOND
    assert kind == "esphome"
    assert packets[0] == (at - LENGTH, "outbound", ASK)  # a line is printed behind the last byte
    assert packets[1] == (at, "inbound", ANSWER)  # in the same second: moved behind the first
    assert packets[2] == (at + 1500 * MS - LENGTH, "inbound", ANSWER)
    assert packets[3][2] == b"\xa5\x01"
    assert (importer.tally.not_understood, importer.tally.coarsest_ns) == (0, SECOND)


def test_esphome_in_decimal_and_through_home_assistant() -> None:
    named = "2026-11-21 12:00:00.500 DEBUG (MainThread) [homeassistant.components.esphome.manager] bms @ 10.0.0.7: "
    text = (
        f"{named}\x1b[0;36m[D][uart_debug:114]: >>> {','.join(map(str, ASK[:4]))}\x1b[0m\n"
        f"{named}[D][uart_debug:114]: >>> 10,12,13\n"
        f"{named}[D][uart_debug:114]: <<< 125\n{named}[D][uart_debug:114]: <<< 77\n"
        f"{named}[D][sensor:094]: 'Voltage': Sending state 52.8 V\n{named}[D][uart_debug:114]: <<< 1,256\n"
    )
    kind, packets, importer = read(text)
    assert kind == "esphome"
    assert b"".join(data for *_, data in packets) == ASK[:4] + bytes((10, 12, 13, 125, 77))
    assert packets[-1][1] == "inbound"
    assert importer.tally.not_understood == 1


def test_dalybms() -> None:
    text = (
        "DEBUG    [daly_bms.py:100] -- 90 ------------------------\n"
        f"DEBUG    [daly_bms.py:70] w {ASK.hex()}\n"
        f"DEBUG    [daly_bms.py:119] 0 {ANSWER.hex()} 13\n"
        f"2026-11-21 12:00:00,250 - DEBUG - 0 {ANSWER[:9].hex()} 9\n"
        "DEBUG    [daly_bms.py:123] response crc mismatch: da != 01\n"
    )
    kind, packets, importer = read(text)
    assert kind == "dalybms"
    assert [(way, data) for _, way, data in packets] == [
        ("outbound", ASK),
        ("inbound", ANSWER),
        ("inbound", ANSWER[:9]),
    ]
    assert importer.tally.not_understood == 0


def test_what_dalybms_really_logs() -> None:
    """The program itself writes the lines, against a port that answers."""
    import logging

    from dalybms import DalyBMS

    class Port:
        is_open = True

        def __init__(self) -> None:
            self.left = [ANSWER]

        def reset_input_buffer(self) -> None: ...
        def reset_output_buffer(self) -> None: ...
        def write(self, data: bytes) -> int:
            return len(data)

        def read(self, _: int) -> bytes:
            return self.left.pop()

    out = io.StringIO()
    logger = logging.getLogger("a log of dalybms")
    logger.setLevel(logging.DEBUG)
    handler = logging.StreamHandler(out)
    handler.setFormatter(logging.Formatter("%(levelname)-8s [%(filename)s:%(lineno)d] %(message)s"))
    logger.addHandler(handler)
    bms = DalyBMS(address=4, logger=logger)  # pyright: ignore[reportUnknownVariableType]
    bms.serial = Port()  # pyright: ignore[reportAttributeAccessIssue]
    assert bms.get_soc()  # pyright: ignore[reportUnknownMemberType]
    kind, packets, _ = read(out.getvalue())
    assert kind == "dalybms"
    assert [(way, data) for _, way, data in packets] == [("outbound", ASK), ("inbound", ANSWER)]


def test_serialbattery() -> None:
    """Lines of issues 212 and 249: CAN, with the identifiers of bursts changed by the driver."""
    text = (
        r"2025-03-17 14:45:01.471894500 DEBUG:SerialBattery:[can0] Received: ID=0x370, Daten=bytearray(b'Lithium\x00')"
        "\n"
        r"2025-04-19 13:14:29.694348500 DEBUG:SerialBattery:[can0] Received: ID=0x18a64002, "
        r"Daten=bytearray(b'\x01\r$\r$\r%\x00')"
        "\n2025-04-19 13:14:29.700000000 DEBUG:SerialBattery:Data check: 2\n"
        f"@4000000067d832cd1c5c2c4c INFO:SerialBattery:reply: {ANSWER.hex()}\n"
    )
    kind, packets, importer = read(text)
    assert kind == "serialbattery"
    assert packets[0][2].hex() == "00000370" + "08000000" + b"Lithium\0".hex()
    assert packets[1][2].hex() == "98954002" + "08000000" + "010d240d240d2500"
    assert packets[2][1:] == ("inbound", ANSWER)
    assert importer.tally.not_understood == 0
    _, packets, importer = read(text + f"2025-04-19 13:14:30 DEBUG:SerialBattery:sentence {ANSWER.hex()}\n")
    assert (len(packets), importer.tally.not_understood) == (3, 1)  # bytes of which nobody says who sent them
    assert on_the_wire(0x18A74001, b"\x02" + bytes(7)) == 0x18954001
    assert on_the_wire(0x18A74001, b"\x01" + bytes(7)) == 0x18964001
    assert on_the_wire(0x18904001, bytes(8)) == 0x18904001


def test_saleae_logic_1_and_2() -> None:
    one = "Time [s],Value,Parity Error,Framing Error\n" + "".join(
        f"{0.5 + place * 0.00104168:.15f},0x{byte:02X},,{'Error' if place == 4 else ''}\n"
        for place, byte in enumerate(ASK)
    )
    two = 'name,type,start_time,duration,"data","error"\n' + "".join(
        f'"UART TX","data",{0.5 + place * 0.00104168:.8f},0.00094,{value},{"framing" if place == 4 else ""}\n'
        for place, value in enumerate(["0xA5", '"@"', "144", "0b1000", *['"\\0"'] * 8, '"}"'])
    )
    for text, way in ((one, ""), (two, "outbound")):
        lines = text.splitlines()
        found = guess(lines)
        assert found is not None
        assert found.name == "saleae"
        importer = Importer("log", "saleae", Options(), Told())
        packets = [packet for packet in importer.packets(io.BytesIO(text.encode())) if packet.data]
        assert b"".join(packet.data for packet in packets) == ASK
        assert {packet.direction for packet in packets} == {way}
        assert [packet.time_ns for packet in packets][:3] == [500_000_000, 501_041_680, 502_083_360]
        assert [bool(packet.flags >> 31) for packet in packets] == [place == 4 for place in range(13)]


def test_saleae_in_decimal_with_dates_and_by_analyzer() -> None:
    decimal = "Time [s],Value,Parity Error,Framing Error\n" + "".join(f"{n}.5,{byte},,\n" for n, byte in enumerate(ASK))
    dated = "name,type,start_time,duration,data\n" + "".join(
        f'"Async Serial","data",2026-11-21T12:34:{n:02}.5+00:00,0.001,0x{byte:02X}\n' for n, byte in enumerate(ASK)
    )
    named = "Time [s],Analyzer Name,Decoded Protocol Result\n" + "".join(
        f"{n}.5,BMS RX,0x{byte:02X}\n" for n, byte in enumerate(ASK)
    )
    for text, start, direction in (decimal, 0, ""), (dated, 1795264440, ""), (named, 0, "inbound"):
        kind, packets, importer = read(text)
        assert kind == "saleae"
        assert packets == [(start * SECOND + n * SECOND + 500 * MS, direction, bytes((b,))) for n, b in enumerate(ASK)]
        assert importer.tally.not_understood == 0


def test_sigrok_and_pulseview() -> None:
    # 1 MHz, 9600 baud: a bit is 104.17 samples; the annotation spans the eight data bits
    lines: list[str] = []
    for place, byte in enumerate(ASK):
        start = 1000 + place * 1042 + 104
        lines += [f"{start - 104}-{start} uart-1: Start bit", f"{start}-{start + 833} uart-1: RX: {byte:02X}"]
        lines.append(f"{start + 833}-{start + 937} uart-1: {'Frame error' if place == 2 else 'Stop bit'}")
    kind, packets, _ = read("\n".join(lines), samplerate=1e6)
    assert kind == "sigrok"
    assert b"".join(data for *_, data in packets) == ASK
    assert {way for _, way, _ in packets} == {"inbound"}
    for place, (at, *_) in enumerate(packets):
        assert abs(at - (1000 + place * 1042) * 1000) < 1000
    _, packets, _ = read("\n".join(lines))  # the rate found from the first byte, and taken as round
    assert abs(packets[-1][0] - packets[0][0] - 12 * 1042 * 1000) < 1000
    quoted = "\n".join(lines).replace("RX: ", 'rx-data: "').replace("\n", '"\n')
    assert read(quoted)[1] == packets
    kind, packets, importer = read("\n".join(f"UART: TX data: {byte:02X}" for byte in ASK))
    assert kind == "sigrok"
    assert b"".join(data for *_, data in packets) == ASK
    assert importer.tally.timed == 0
    importer = Importer("log", "sigrok", Options(), Told())
    flags = [p.flags >> 31 for p in importer.packets(io.BytesIO("\n".join(lines).encode())) if p.data]
    assert flags == [int(place == 2) for place in range(13)]


def test_nrf_connect() -> None:
    ask = bytes.fromhex("D203000C000157AA")  # the article's
    answer = bytes.fromhex("D203020001FC56")
    text = (
        "nRF Connect, 2026-08-26\nDL-D11A04015994 (D1:1A:04:01:59:94)\n"
        "V\t19:33:29.820\tConnecting to D1:1A:04:01:59:94...\n"
        "Unknown Service (0000fff0-0000-1000-8000-00805f9b34fb)\n- Unknown Characteristic [N R] (0000fff1-...)\n"
        f"I\t19:33:31.001\tData written to 0000fff2-0000-1000-8000-00805f9b34fb, value: (0x) {spaced(ask, '-')}\n"
        "I\t19:33:31.152\tNotification received from 0000fff1-0000-1000-8000-00805f9b34fb, "
        f"value: (0x) {spaced(answer, '-')}\n"
        "I\t19:33:32.000\tNotification received from 00002a19-0000-1000-8000-00805f9b34fb, value: (0x) 64\n"
    )
    kind, packets, importer = read(text)
    at = 20691 * 24 * HOUR + 19 * HOUR + 33 * 60 * SECOND + 31 * SECOND  # 2026-08-26
    assert kind == "nrfconnect"
    assert packets == [(at + MS, "outbound", ask), (at + 152 * MS, "inbound", answer)]
    assert importer.tally.not_understood == 0
    _, packets, _ = read(text.replace("\t19:33:32", "\t00:00:01").replace("00002a19", "0000fff1"))
    assert packets[2][0] - packets[1][0] == (4 * HOUR + 26 * 60 * SECOND + 29 * SECOND + 848 * MS)  # the next day


@pytest.mark.parametrize("line", ["[{}] {}: {}", "{},DL-D11A04015994,{},{}", '{},DL-D11A04015994,{},"{}"'])
def test_nrf_connect_on_ios(line: str) -> None:
    """Shaped after nordicsemi/IOS-nRF-Connect 174; the values are the article's."""
    told = [
        ("12:35:26.6520", "Verbose", "Connecting..."),
        ("12:35:26.9930", "Debug", "[Callback] centralManager(central, didConnect: peripheral)"),
        ("12:35:28.4710", "Debug", "peripheral.writeValue(0xD203000C000157AA, for: FFF2, type: .withoutResponse)"),
        ("12:35:28.5720", "Normal", "Updated Value of Characteristic FFF1 to D203 0200 01FC 56."),
        ("12:35:28.5720", "Application", "Value D203 0200 01FC 56 received."),
        ("12:35:29.1000", "Normal", "Updated Value of Characteristic 2A19 to 64."),
    ]
    kind, packets, importer = read("".join(line.format(*one) + "\n" for one in told))
    at = 12 * HOUR + 35 * 60 * SECOND + 28 * SECOND
    assert kind == "nrfconnect"
    assert packets == [
        (at + 471 * MS, "outbound", bytes.fromhex("D203000C000157AA")),
        (at + 572 * MS, "inbound", bytes.fromhex("D203020001FC56")),
    ]
    assert importer.tally.not_understood == 0


def test_hex_dumps() -> None:
    data = (ASK + ANSWER) * 3 + bytes(64)
    xxd = "".join(f"{at:08x}: {data[at : at + 16].hex(' ', 2):39}  {'.' * 16}\n" for at in range(0, len(data), 16))
    canonical = "".join(
        f"{at:08x}  {data[at : at + 8].hex(' ')}  {data[at + 8 : at + 16].hex(' ')}  |{'.' * 16}|\n"
        for at in range(0, 96, 16)
    )
    canonical += (
        f"*\n{len(data) - len(data) % 16:08x}  {data[len(data) - len(data) % 16 :].hex(' ')}\n{len(data):08x}\n"
    )
    for text in (xxd, canonical):
        kind, packets, importer = read(text)
        assert kind == "hexdump"
        assert b"".join(part for *_, part in packets) == data
        assert importer.tally.not_understood == 0
    _, packets, importer = read(xxd + "00000fff: 0102\n")
    assert importer.tally.not_understood == 1  # it does not go on there


def test_dumps_of_words_in_octal_and_of_packets() -> None:
    """hexdump without -C prints words, the low byte first: read as bytes, each pair was swapped."""
    data = ASK + ANSWER + bytes(40) + b"\x01"  # 67: an odd number, so the last word is filled up
    even = data + b"\0"

    def dumped(offset: str, step: int) -> str:
        lines = [f"{at:{offset}}" for at in range(0, len(data), 16)]
        parts = [even[at : at + 16] for at in range(0, len(data), 16)]
        if step == 2:
            shown = [" ".join(part[n : n + 2][::-1].hex() for n in range(0, len(part), 2)) for part in parts]
        else:
            shown = [data[at : at + 16].hex(" ") for at in range(0, len(data), 16)]
        text = "".join(f"{at} {part}\n" for at, part in zip(lines, shown, strict=True))
        return text.replace(lines[3] + " " + shown[3] + "\n", "*\n") + f"{len(data):{offset}}\n"

    assert " 40a5 0890 " in dumped("07x", 2)
    for text in (dumped("07x", 2), dumped("07o", 2), dumped("07o", 1), dumped("06x", 1)):
        kind, packets, importer = read(text)
        assert kind == "hexdump"
        assert b"".join(part for *_, part in packets) == data
        assert importer.tally.not_understood == 0
    packet = "0000   {}   ........\n"
    for text in (packet, "0000  {}\n"):
        kind, packets, _ = read(text.format(ASK.hex(" ")) + "\n" + text.format(ANSWER.hex(" ")))
        assert (kind, b"".join(part for *_, part in packets)) == ("hexdump", ASK + ANSWER)
    assert read("A540 9008 0000\n")[0] == "hex"


def test_a_dump_with_half_a_byte_is_not_understood() -> None:
    _, packets, importer = read("00000000: a540 9008 0000\n00000006: 000 0000\n")
    assert b"".join(part for *_, part in packets) == bytes.fromhex("a54090080000")
    assert importer.tally.not_understood == 1


def test_every_kind_says_what_it_is() -> None:
    for name, made in KINDS.items():
        assert made().name == name
        assert len(made().about) > 20
