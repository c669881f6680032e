# SPDX-License-Identifier: GPL-2.0-or-later
"""The capture tool inside tshark and Wireshark: its answers, and that it never hangs whoever started it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.capture.bus import Bus, numbered
from tests.capture.extcap_tool import START, Home
from tests.capture.test_passive import STRACE, calls_on, can_trace

from dalycapture import extcap, extcap_names
from dalycapture.adapters import Adapter
from dalycapture.reader import read_capture
from dalycapture.toolbar import message

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from dalyref.packet import Packet

ADAPTERS = [
    Adapter("/dev/ttyUSB0", by_id="/dev/serial/by-id/usb-FTDI_X-port0", hardware="FTDI {evil}\nFT232R (0403:6001)"),
    Adapter("/dev/ttyUSB1"),
]


@pytest.fixture
def two_adapters(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dalycapture.adapters.adapters", lambda: ADAPTERS)


def sentences(*words: str) -> list[tuple[str, dict[str, str]]]:
    """Answers, taken apart as Wireshark does: a word, then {name=value} parts."""
    found: list[tuple[str, dict[str, str]]] = []
    for line in extcap.answer(extcap.parse(words)):
        kind, _, rest = line.partition(" ")
        parts = re.findall(r"\{([a-z]+)=([^{}]*)\}", rest)
        assert rest == "".join(f"{{{name}={value}}}" for name, value in parts), line
        found.append((kind, dict(parts)))
    return found


@pytest.mark.usefixtures("two_adapters")
def test_interfaces_and_toolbar() -> None:
    got = sentences("--extcap-interfaces", "--extcap-version=4.4", "--something-newer", "x")
    assert [parts["value"] for kind, parts in got if kind == "interface"] == [
        "daly",
        "/dev/serial/by-id/usb-FTDI_X-port0",
        "/dev/ttyUSB1",
    ]
    assert [parts["display"] for kind, parts in got if kind == "interface"] == [
        "Daly BMS",
        "Daly BMS on FTDI evilFT232R (0403:6001) (/dev/ttyUSB0)",
        "Daly BMS on /dev/ttyUSB1",
    ]
    controls = [(parts["type"], parts.get("role", "")) for kind, parts in got if kind == "control"]
    assert controls == [("string", ""), ("string", ""), ("button", ""), ("button", "logger")]
    assert len({parts["number"] for kind, parts in got if kind == "control"}) == 4


@pytest.mark.usefixtures("two_adapters")
@pytest.mark.parametrize("interface", ["daly", "/dev/ttyUSB1"])
def test_options(interface: str) -> None:
    """Only types that 4.0 knows: a sentence it can't read takes the whole interface's preferences with it."""
    known = {
        "integer",
        "unsigned",
        "long",
        "double",
        "string",
        "boolean",
        "boolflag",
        "selector",
        "radio",
        "fileselect",
    }
    got = sentences("--extcap-config", "--extcap-interface", interface)
    arguments = {parts["number"]: parts for kind, parts in got if kind == "arg"}
    assert {parts["type"] for parts in arguments.values()} <= known
    assert len(arguments) == sum(kind == "arg" for kind, _ in got)
    for kind, parts in got:
        if kind == "value":
            assert arguments[parts["arg"]]["type"] == "selector"
    for number, parts in arguments.items():
        values = [value for kind, value in got if kind == "value" and value["arg"] == number]
        if parts["type"] == "selector":
            assert sum("default" in value for value in values) == 1
    names = [parts["call"] for parts in arguments.values()]
    assert ("--port" in names) == (interface == "daly")
    assert {"--baud", "--format", "--modem-lines", "--mirror"} <= set(names)


@pytest.mark.usefixtures("two_adapters")
def test_reload_gives_the_values_of_that_option_alone() -> None:
    got = sentences("--extcap-config", "--extcap-interface", "daly", "--extcap-reload-option", "port", "--baud", "9600")
    assert [(kind, parts["arg"], parts["value"]) for kind, parts in got] == [
        ("value", "0", "/dev/serial/by-id/usb-FTDI_X-port0"),
        ("value", "0", "/dev/ttyUSB1"),
    ]
    assert sentences("--extcap-config", "--extcap-interface", "daly", "--extcap-reload-option", "baud") == []


def test_no_adapter_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dalycapture.adapters.adapters", list)
    got = sentences("--extcap-config", "--extcap-interface", "daly", "--extcap-reload-option", "port")
    assert got[0][1]["display"].startswith("no serial adapter found")


def test_link_type_is_the_one_that_is_written() -> None:
    """USER0 is 147 (the registry); what is announced must be what comes."""
    ((kind, parts),) = sentences("--extcap-dlts", "--extcap-interface", "daly")
    assert (kind, parts["number"], parts["name"]) == ("dlt", "147", "USER0")


def test_capture_filter() -> None:
    """Nothing said: valid."""
    ask = ("--extcap-interface", "daly", "--extcap-capture-filter")
    assert list(extcap.answer(extcap.parse([*ask, ""]))) == []
    assert list(extcap.answer(extcap.parse(ask))) == []
    (said,) = extcap.answer(extcap.parse([*ask, "tcp port 80"]))
    assert "no capture filter" in said


@pytest.mark.parametrize(
    ("words", "options"),
    [
        (["--a", "1", "--b=2", "--c"], {"a": "1", "b": "2", "c": "true"}),
        (["--low-latency", "--baud", "9600"], {"low-latency": "true", "baud": "9600"}),
        (["--low-latency", "false"], {"low-latency": "false"}),
        (["stray", "--a", "-5", "--a", "7"], {"a": "7"}),
        (["--filter", ""], {"filter": ""}),
    ],
)
def test_words(words: list[str], options: dict[str, str]) -> None:
    assert extcap.parse(words) == options


def test_started_by_a_person(capsys: pytest.CaptureFixture[str]) -> None:
    assert extcap.main([]) == 2
    assert "Wireshark, which starts it by itself" in capsys.readouterr().err


@pytest.mark.parametrize("question", [["--extcap-interfaces"], ["--extcap-config", "--extcap-interface", "daly"]])
def test_discovery_imports_little(question: list[str]) -> None:
    """All tools are asked at every start, several times: pyserial alone would double the wait."""
    code = f"import sys; from dalycapture.extcap import main; main({question!r}); print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"serial", "rich", "argparse", "hashlib", "socket", "dalycapture.port"} & set(done.stderr.split())


@pytest.mark.skipif(not can_trace(), reason="strace is missing or may not trace here (ptrace)")
def test_discovery_opens_no_port(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    for question in (["--extcap-interfaces"], ["--extcap-config", "--extcap-interface", "daly"]):
        command = [
            str(STRACE),
            "-f",
            "-o",
            str(trace),
            "-e",
            "trace=open,openat",
            sys.executable,
            "-c",
            START,
            *question,
        ]
        subprocess.run(command, check=True, capture_output=True)
        opened = re.findall(r'open(?:at)?\(.*?"([^"]+)"', trace.read_text(encoding="utf-8", errors="replace"))
        assert any(name.startswith("/sys/class/tty") for name in opened)  # the trace did see it look
        assert not [name for name in opened if re.match(r"/dev/(tty|pts|serial/by-[a-z]+/)", name)]


# --- captures that Wireshark starts: our own hand plays Wireshark, with fifo and control pipes ------------------------


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.01)


class Capture:
    """The tool as the window starts it."""

    def __init__(self, folder: Path, port: str, *words: str, under: tuple[str, ...] = ()) -> None:
        self.fifo, self.outward, self.inward = (folder / name for name in ("fifo", "out", "in"))
        for path in (self.fifo, self.outward, self.inward):
            os.mkfifo(path)
        self.got = b""
        self.told = b""
        pipes = ["--fifo", self.fifo, "--extcap-control-out", self.outward, "--extcap-control-in", self.inward]
        self.process = subprocess.Popen(
            [
                *under,
                sys.executable,
                "-c",
                START,
                "--capture",
                "--extcap-interface",
                "daly",
                "--port",
                port,
                *pipes,
                *words,
            ],
            stderr=subprocess.PIPE,
        )
        self._told = os.open(self.outward, os.O_RDONLY | os.O_NONBLOCK)
        self.control = os.open(self.inward, os.O_RDWR)
        self.data = os.open(self.fifo, os.O_RDONLY | os.O_NONBLOCK)

    def read(self) -> list[Packet]:
        """What came so far."""
        for name, fd in (("got", self.data), ("told", self._told)):
            with_more = True
            while with_more:
                try:
                    piece = os.read(fd, 65536)
                except BlockingIOError:
                    piece = b""
                setattr(self, name, getattr(self, name) + piece)
                with_more = bool(piece)
        with tempfile.NamedTemporaryFile() as file:
            file.write(self.got)
            file.flush()
            return list(read_capture(file.name)) if len(self.got) > 100 else []

    def said(self) -> str:
        assert self.process.stderr
        self.process.wait(30)
        return self.process.stderr.read().decode()

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stderr
        self.process.stderr.close()
        for fd in (self.data, self._told, self.control):
            with suppress(OSError):
                os.close(fd)


@contextmanager
def captured(folder: Path, port: str, *words: str, under: tuple[str, ...] = ()) -> Generator[Capture]:
    capture = Capture(folder, port, *words, under=under)
    try:
        yield capture
    finally:
        capture.close()


@pytest.fixture
def bus() -> Iterator[Bus]:
    with Bus() as one:
        yield one


def messages(data: bytes) -> list[tuple[int, int, str]]:
    """Take the tool's messages apart, as extcap(4) lays them out: (control, command, text)."""
    found: list[tuple[int, int, str]] = []
    while data:
        assert data[:1] == b"T"
        size = int.from_bytes(data[1:4], "big")
        found.append((data[4], data[5], data[6 : 4 + size].decode()))
        data = data[4 + size :]
    return found


def test_toolbar_counts_and_marks(bus: Bus, tmp_path: Path) -> None:
    with captured(tmp_path, bus.port) as capture:
        until(lambda: not capture.read() and b"dalyshark bus=main" in capture.got)
        bus.send(numbered(1) + numbered(2))
        until(lambda: len(capture.read()) == 2)
        os.write(capture.control, message(0, 0, ""))  # Wireshark is ready
        os.write(capture.control, message(extcap_names.MARK_TEXT, 1, "charger plugged in"))
        os.write(capture.control, message(extcap_names.MARK, 1, ""))
        until(lambda: len(capture.read()) == 3)
        assert capture.read()[2].comment == "user mark 1: charger plugged in"
        until(lambda: capture.read() and "2 records" in capture.told.decode())
        capture.process.send_signal(signal.SIGTERM)
        assert capture.said() == ""
    told = messages(capture.told)
    assert {control for control, command, _ in told if command == 1} == {extcap_names.HEARD}
    log = "".join(text for control, command, text in told if (control, command) == (extcap_names.LOG, 2))
    assert f"listening to {bus.port}\n" in log
    assert "user mark 1: charger plugged in\n" in log


@pytest.mark.parametrize(
    "hostile", [b"X" * 40, b"T\xff\xff\xff\x02\x01", b"T\x00\x00\x00\x02\x01", message(9, 77, "?")]
)
def test_nonsense_from_the_toolbar_ends_nothing(hostile: bytes, bus: Bus, tmp_path: Path) -> None:
    with captured(tmp_path, bus.port) as capture:
        os.write(capture.control, hostile)
        bus.send(numbered(1))
        until(lambda: len(capture.read()) == 1)
        capture.process.send_signal(signal.SIGTERM)
        assert capture.said() == ""


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_reader_that_is_gone_ends_it_on_a_silent_bus(mirrored: bool, bus: Bus, tmp_path: Path) -> None:
    mirror = tmp_path / "mirror.pcapng"
    words = ["--mirror", str(mirror)] if mirrored else []
    with captured(tmp_path, bus.port, *words) as capture:
        bus.send(numbered(1))
        until(lambda: len(capture.read()) == 1)
        os.close(capture.data)
        assert capture.said() == ""
    if mirrored:
        assert [p.data for p in read_capture(mirror)] == [numbered(1)]


def test_a_mirror_has_all_and_is_added_to(bus: Bus, tmp_path: Path) -> None:
    mirror = tmp_path / "mirror.pcapng"
    for life in range(2):
        folder = tmp_path / str(life)
        folder.mkdir()
        with captured(folder, bus.port, "--mirror", str(mirror), "--mirror-sha256") as capture:
            bus.send(numbered(life))
            until(lambda life=life: mirror.exists() and mirror.read_bytes().count(numbered(life)) == 1)
            capture.process.send_signal(signal.SIGTERM)
            assert capture.said() == ""
            assert [p.data for p in capture.read()] == [numbered(life)]
    assert [p.data for p in read_capture(mirror)] == [numbered(0), numbered(1)]
    assert (tmp_path / "mirror.pcapng.sha256").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--port", "/dev/none"], "/dev/none is not there"),
        (["--baud", "fast"], "baud rate 'fast' is not a number"),
        (["--format", "9Z9"], "format '9Z9' is not known"),
        (["--modem-lines", "up"], "'up' is not known; use leave or drop"),
        (["--bus", "two words"], "bus name 'two words' is not one word"),
        (["--mirror", "/nowhere/x.pcapng"], "there is no directory /nowhere"),
        (["--extcap-capture-filter", "tcp"], "no capture filter"),
    ],
)
def test_start_errors_open_the_fifo_and_say_why(words: list[str], said: str, bus: Bus, tmp_path: Path) -> None:
    with captured(tmp_path, bus.port, *words) as capture:
        assert said in capture.said()
        assert capture.read() == []
        assert capture.got == b""
        assert capture.process.returncode == 1


def test_defaults_hold_when_options_are_missing(bus: Bus, tmp_path: Path) -> None:
    """What tshark leaves out (selectors), and values that are words alone."""
    with captured(
        tmp_path, bus.port, "--format", "--modem-lines", "--bus", "--mirror", "--low-latency=false"
    ) as capture:
        bus.send(numbered(1))
        until(lambda: len(capture.read()) == 1)
        (packet,) = capture.read()
    assert packet.description.startswith(f"dalyshark bus=main 9600 8N1 {bus.port}; ")


@pytest.mark.skipif(not can_trace(), reason="strace is missing or may not trace here (ptrace)")
def test_nothing_but_listening(bus: Bus, tmp_path: Path) -> None:
    """As test_passive has it for `dalyshark capture`: no write, no flush, no modem line moved, a mark meanwhile."""
    trace = tmp_path / "trace"
    with captured(tmp_path, bus.port, under=(str(STRACE), "-f", "-y", "-o", str(trace))) as capture:
        bus.send(numbered(1))
        until(lambda: len(capture.read()) == 1)
        os.write(capture.control, message(extcap_names.MARK, 1, ""))
        until(lambda: len(capture.read()) == 2)
        assert bus.heard() == b""
        os.close(capture.data)
        assert capture.said() == ""
    calls = calls_on(trace.read_text(encoding="utf-8", errors="replace"), bus.port)
    on_port = [(name, rest) for name, rest in calls if re.match(rf"\d+<{bus.port}[<>]", rest)]
    names = {name for name, _ in on_port}
    assert {"ioctl", "read"} <= names
    assert not {"write", "writev", "sendto"} & names
    forbidden = r"TIOCM(BIS|BIC|SET)|TCSBRK|TIOCSBRK|TIOCSTI|TCFLSH|TCSETSF|TCSETSW|TCXONC"
    assert not [rest for name, rest in on_port if name == "ioctl" and re.search(forbidden, rest)]


# --- the real tshark, as an ordinary user ---------------------------------------------------------------------------


@pytest.fixture
def home() -> Iterator[Home]:
    with tempfile.TemporaryDirectory(prefix="dalyshark-test-") as name:
        yield Home(Path(name))


@contextmanager
def feeding(bus: Bus) -> Generator[None]:
    """A bus on which somebody talks."""
    done = threading.Event()

    def feed() -> None:
        number = 0
        while not done.wait(0.02):
            bus.send(numbered(number))
            number += 1

    feeder = threading.Thread(target=feed)
    feeder.start()
    try:
        yield
    finally:
        done.set()
        feeder.join()


@pytest.fixture
def shared_bus(bus: Bus) -> Bus:
    Path(bus.port).chmod(0o666)
    return bus


def preference(name: str, value: str) -> list[str]:
    return ["-o", f"extcap.daly.{name}:{value}"]


def test_tshark_lists_it(home: Home) -> None:
    status, out, _ = home.run("-D")
    assert status == 0
    assert re.search(r"(?m)^\d+\. daly \(Daly BMS\)$", out)
    assert "sentence" not in out  # one that it could not read
    status, out, _ = home.run("-i", "daly", "-L")
    assert "USER0" in out


def test_tshark_captures(home: Home, shared_bus: Bus) -> None:
    with feeding(shared_bus):
        mirror = home.folder / "mirror.pcapng"
        options = [*preference("port", shared_bus.port), *preference("mirror", str(mirror))]
        status, _, err = home.run("-i", "daly", *options, "-c", "5", "-w", "x.pcapng")
    assert (status, "rror" in err) == (0, False), err
    packets = list(read_capture(home.folder / "x.pcapng"))
    first = int("".join(str(byte) for byte in packets[0].data[4:12]))
    assert [p.data for p in packets] == [numbered(first + n) for n in range(5)]
    assert packets[0].description.startswith(f"dalyshark bus=main 9600 8N1 {shared_bus.port}; ")
    mirrored = [p.data for p in read_capture(mirror)]
    assert mirrored[: len(packets)] == [p.data for p in packets]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (preference("port", "/dev/none"), "/dev/none is not there"),
        (["-f", "tcp", *preference("port", "/dev/none")], "no capture filter"),
        (preference("mirror", "/nowhere/x.pcapng"), "there is no directory /nowhere"),
    ],
)
def test_tshark_is_told_of_start_errors(words: list[str], said: str, home: Home, shared_bus: Bus) -> None:
    """That it ends at all is the point: a tool that does not open the fifo hangs tshark for ever."""
    port = [] if "port:" in " ".join(words) else preference("port", shared_bus.port)
    status, _, err = home.run("-i", "daly", *port, *words, "-w", "x.pcapng")
    assert status != 0
    assert said in err


@pytest.mark.parametrize("ending", ["stopped", "tshark killed"])
def test_no_tool_is_left_behind(ending: str, home: Home, shared_bus: Bus) -> None:
    process = home.start("-i", "daly", *preference("port", shared_bus.port), "-w", "x.pcapng")
    try:
        until(lambda: tools(shared_bus.port))
        shared_bus.send(numbered(1))
        path = home.folder / "x.pcapng"
        until(lambda: path.exists() and numbered(1) in path.read_bytes())
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text(encoding="ascii").split()
        if ending == "stopped":
            process.send_signal(signal.SIGINT)
            process.wait(30)
        else:
            process.kill()
            for child in children:  # dumpcap would go on by itself; the tool must see that its reader went
                if "dumpcap" in Path(f"/proc/{child}/comm").read_text(encoding="ascii"):
                    os.kill(int(child), signal.SIGKILL)
        until(lambda: not tools(shared_bus.port))
    finally:
        process.kill()
        process.communicate()


def tools(port: str) -> list[int]:
    """Capture tools that listen to this port now."""
    found: list[int] = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words: Any = (process / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if b"--capture" in words and port.encode() in words:
            found.append(int(process.name))
    return found
