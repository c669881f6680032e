# SPDX-License-Identifier: GPL-2.0-or-later
"""The sniffer inside Wireshark: what it asks of a capture tool (extcap), and our answers.

Wireshark and tshark start the tool anew for each question (extcap(4); what they really send: capture notes, 6)::

    --extcap-interfaces --extcap-version=4.4           which interfaces, and what is in the toolbar
    --extcap-config --extcap-interface I               which options
        ... --extcap-reload-option port                the values of one of them, again
    --extcap-dlts --extcap-interface I                 which link type
    --extcap-capture-filter F --extcap-interface I     is this filter valid? Nothing: yes. Text: what is wrong
    --capture --extcap-interface I --fifo P ...        capture (dalycapture.extcap_capture)

They ask all tools at every start: answers come from the system's tables, no port is opened, and little is imported.
Unknown words are passed over, for newer versions send more.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Final, NoReturn

from dalycapture.extcap_names import FILTERS, HEARD, INTERFACE, LOG, MARK, MARK_TEXT

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dalycapture.adapters import Adapter

DISPLAY: Final = "Daly BMS"
VERSION: Final = "1.0"  # of this tool's side of the conversation

_CONTROLS: Final = (
    (HEARD, "string", "Heard", "Records so far; bad: damaged frames; boards that answered"),
    (MARK_TEXT, "string", "Mark", "Text of the next mark: type it, press Enter, then Set mark"),
    (MARK, "button", "Set mark", "Put a mark with this text into the capture, at this moment"),
)
_FORMATS: Final = ("8N1", "8E1", "8O1", "8N2", "7E1", "7O1")
_MODEM_LINES: Final = (
    ("leave", "leave them as the system sets them"),
    ("drop", "drop both at once (adapters that drive the bus by RTS)"),
)


def parse(words: Sequence[str]) -> dict[str, str]:
    """Read ``--name value``, ``--name=value`` and ``--name`` alone (``true``) in any order; the last one counts."""
    options: dict[str, str] = {}
    name = ""
    for word in words:
        if word.startswith("--") and len(word) > 2:
            name, equals, value = word[2:].partition("=")
            options[name] = value if equals else "true"
            name = "" if equals else name
        elif name:
            options[name] = word
            name = ""
    return options


def answer(options: dict[str, str]) -> Iterator[str]:
    """Answer a question, a line a sentence. Raises KeyError where none of ours was asked."""
    if "extcap-interfaces" in options:
        yield from _interfaces()
    elif "extcap-config" in options:
        yield from _config(options["extcap-interface"], options.get("extcap-reload-option"))
    elif "extcap-dlts" in options:
        yield _sentence("dlt", number=147, name="USER0", display="Daly BMS, bytes of a serial line")
    elif options["extcap-capture-filter"] not in {"", "true"}:
        yield FILTERS


def _interfaces() -> Iterator[str]:
    yield _sentence("extcap", version=VERSION, display="Daly BMS sniffer (dalyshark)")
    yield _sentence("interface", value=INTERFACE, display=DISPLAY)
    for adapter in _adapters():
        yield _sentence("interface", value=adapter.stable_name, display=f"{DISPLAY} on {_named(adapter)}")
    for number, kind, display, tooltip in _CONTROLS:
        yield _sentence("control", number=number, type=kind, display=display, tooltip=tooltip)
    yield _sentence("control", number=LOG, type="button", role="logger", display="Log", tooltip="Events and losses")


def _config(interface: str, reload: str | None) -> Iterator[str]:
    """Options of an interface; on reload the values of one alone."""
    if reload is not None:
        if reload == "port":
            yield from _ports()
        return
    if interface == INTERFACE:
        said = "Serial adapter, by the name that stays the same"
        yield _argument(0, "port", "Port", "selector", said, reload="true", group="Port")
        yield from _ports()
        said = "Instead of an adapter of the list: a device, socket://HOST:PORT or rfc2217://HOST:PORT"
        yield _argument(9, "address", "Other port", "string", said, group="Port")
    said = "Bits per second; Daly's is 9600"
    yield _argument(1, "baud", "Baud rate", "unsigned", said, default=9600, range="1,100000000", group="Port")
    yield _argument(2, "format", "Format", "selector", "Data bits, parity, stop bits", group="Port")
    yield from (_value(2, text, text, default=text == _FORMATS[0]) for text in _FORMATS)
    yield _argument(3, "modem-lines", "RTS and DTR", "selector", "The system raises both at opening", group="Port")
    yield from (_value(3, value, text, default=value == "leave") for value, text in _MODEM_LINES)
    said = "Ask the driver to hand bytes over at once (FTDI: latency timer of 1 ms): better times"
    yield _argument(4, "low-latency", "Low latency", "boolflag", said, group="Port")
    yield _argument(5, "bus", "Name of the bus", "string", "One word; taps of one bus have the same", group="Port")
    said = "Our own file of evidence, written beside; what is there is appended to. Wireshark's own file loses packets "
    said += "without a word when the disk is full"
    yield _argument(6, "mirror", "Mirror file", "fileselect", said, mustexist="false", group="Evidence")
    said = "Leave a checksum file (sha256sum -c) beside the mirror file"
    yield _argument(7, "mirror-sha256", "Checksum", "boolflag", said, group="Evidence")
    said = "Comment each record with how exactly its time is known"
    yield _argument(8, "verbose", "Bounds of times", "boolflag", said, group="Evidence")


def _ports() -> Iterator[str]:
    """Values of the option "port"."""
    found = _adapters()
    for number, adapter in enumerate(found):
        yield _value(0, adapter.stable_name, _named(adapter), default=number == 0)
    if not found:
        yield _value(0, "", "no serial adapter found: plug one in, and reload", default=True)


def _adapters() -> list[Adapter]:
    from dalycapture.adapters import adapters

    return adapters()


def _named(adapter: Adapter) -> str:
    return f"{adapter.hardware} ({adapter.device})" if adapter.hardware else adapter.device


def _argument(number: int, call: str, display: str, kind: str, tooltip: str, **more: object) -> str:
    return _sentence("arg", number=number, call=f"--{call}", display=display, type=kind, tooltip=tooltip, **more)


def _value(argument: int, value: str, display: str, *, default: bool) -> str:
    more = {"default": "true"} if default else {}
    return _sentence("value", arg=argument, value=value, display=display, **more)


def _sentence(kind: str, **parts: object) -> str:
    """Lay out ``kind {name=value}...``; what would end a part, or the line, is left out of values."""
    return f"{kind} " + "".join(f"{{{name}={_plain(str(value))}}}" for name, value in parts.items())


def _plain(text: str) -> str:
    return "".join(letter for letter in text if letter.isprintable() and letter not in "{}")


def main(words: Sequence[str]) -> int:
    """Answer, or capture; exit status."""
    options = parse(words)
    if "capture" in options:
        from dalycapture.extcap_capture import capture

        return capture(options)
    try:
        sys.stdout.write("".join(f"{line}\n" for line in answer(options)))
        sys.stdout.flush()
    except KeyError:
        sys.stderr.write(
            "This is dalyshark's capture tool for Wireshark, which starts it by itself: see dalyshark install\n"
        )
        return 2
    except BrokenPipeError:
        return 0
    return 0


def entry() -> NoReturn:
    """Start as a program."""
    sys.exit(main(sys.argv[1:]))
