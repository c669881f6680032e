# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark simulate``: boards and hosts on pseudo-terminals until stopped, or straight into a capture."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dalytools.problem import Problem
from dalytools.simulator.live import SimulatedBus
from dalytools.simulator.scenario import Board, Damage, Habits, Host, Pack, Scenario
from dalytools.simulator.scenario_file import WIRES as WIRE_NAMES
from dalytools.simulator.scenario_file import example_text, read_scenario, ready_made
from dalytools.simulator.truth import Truth
from dalytools.terminal_text import counted
from dalytools.whole_file import whole_file

if TYPE_CHECKING:
    from types import FrameType

_LINGER_S = 0.3  # a reader of the tap gets the last bytes before the port is hung up
_IN_THE_FILE = (
    "boards",
    "cells",
    "sensors",
    "soc",
    "pack_speed",
    "asleep",
    "fault",
    "frame_base",
    "reserved",
    "sensor_frames",
    "host",
    "host_address",
    "damage",
)


def board_numbers(text: str) -> list[int]:
    """Board numbers from words such as ``1``, ``1,2`` or ``1-3,7``."""
    numbers: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        try:
            low = int(first)
            high = int(last) if dash else low
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} are no board numbers: write 1 or 1,2 or 1-3") from None
        if not 1 <= low <= high <= 16:
            raise argparse.ArgumentTypeError(f"{part!r}: boards are numbered 1 to 16")
        numbers += range(low, high + 1)
    return numbers


def _address(text: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no address: write 0x40 or 64") from None


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r}: must be a number above 0")
    return value


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line of ``dalyshark simulate``."""
    parser.description = (
        "A Daly bus without hardware. Prints the path of a tap (listen there) and of a client port (ask the boards "
        "there), then runs until stopped; or, with -w, writes a capture of it as fast as it can. What happens on the "
        "bus stands in a SCENARIO file, or is made up from the options below."
    )
    parser.add_argument(
        "scenario", nargs="?", metavar="SCENARIO", help="a scenario file (TOML), or the name of a ready-made one"
    )
    parser.add_argument("--list", action="store_true", help="list the ready-made scenarios, and end")
    parser.add_argument(
        "--example", action="store_true", help="print a scenario file with every key explained, and end"
    )
    add = parser.add_argument_group("capture").add_argument
    add("-w", dest="output", metavar="FILE", help="write a capture instead; - is standard output")
    add("--wire", choices=WIRE_NAMES, help="what carries the traffic (the scenario's own, or uart)")
    add("-F", dest="file_format", choices=["pcapng", "pcap"], default="pcapng", help="file format (pcapng)")
    add("--truth", type=Path, metavar="FILE", help="write what was put into the traffic, and when, as JSON")
    add = parser.add_argument_group("boards").add_argument
    add("--boards", type=board_numbers, default=[1], metavar="LIST", help="board numbers, such as 1,2 or 1-3 (1)")
    add("--cells", type=int, default=16, metavar="N", help="cells in series, 1 to 48 (16)")
    add("--sensors", type=int, default=2, metavar="N", help="temperature sensors, 1 to 21 (2)")
    add("--soc", type=float, default=62.5, metavar="PERCENT", help="state of charge at the start (62.5)")
    add(
        "--pack-speed",
        type=float,
        default=1.0,
        metavar="X",
        help="battery time: 0 stands still, 60 an hour a minute (1)",
    )
    add(
        "--asleep",
        choices=["echo", "silence"],
        default="",
        help="the boards sleep: requests come back, or nothing does",
    )
    add("--fault", action="append", default=[], metavar="NAME", help="set this fault, such as short_circuit_protect")
    add("--frame-base", type=int, choices=[0, 1], default=1, help="first frame number of 0x95 and 0x96 (1)")
    add("--reserved", choices=["stale", "zero", "ff"], default="stale", help="what stands in reserved bytes (stale)")
    add("--sensor-frames", type=int, default=1, metavar="N", help="at least so many frames of 0x96 (1; 2 was seen)")
    add = parser.add_argument_group("bus").add_argument
    add("--host", action=argparse.BooleanOptionalAction, default=True, help="a host polls the boards, or clients only")
    add("--host-address", type=_address, metavar="ADDRESS", help="the host asks this address only (each board's own)")
    add("--baud", type=int, default=9600, help="baud rate of the wire (9600)")
    add("--damage", type=float, default=0.0, metavar="RATE", help="share of frames damaged, 0 to 1 (0)")
    add("--seed", type=int, default=1, metavar="N", help="the same seed gives the same values (1)")
    add = parser.add_argument_group("run").add_argument
    add("--replay", type=Path, metavar="FILE", help="play this capture on the tap instead")
    add("--then-simulate", action="store_true", help="after the replay the boards take over")
    add("--speed", type=_positive, default=1.0, metavar="X", help="play the capture so many times as fast (1)")
    add(
        "--longest-silence",
        type=_positive,
        default=2.0,
        metavar="S",
        help="silences in the capture are cut to this (2)",
    )
    add("--duration", type=_positive, metavar="S", help="stop after so many seconds (a capture: the scenario's own)")
    add("--link", type=Path, metavar="DIR", help="stable names: links DIR/tap and DIR/client")


def chosen(args: argparse.Namespace) -> Scenario:
    """Read the scenario file, or make one up from the options; not both, but for seed and baud. Raises Problem."""
    if not args.scenario:
        return scenario(args)
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    plain = parser.parse_args([])
    for option in _IN_THE_FILE:
        if getattr(args, option) != getattr(plain, option):
            word = "--no-host" if option == "host" else "--" + option.replace("_", "-")
            raise Problem(f"{word} and a scenario do not go together: say it in the file; --example shows how")
    found = read_scenario(args.scenario)
    seed = args.seed if args.seed != plain.seed else found.seed
    baud = args.baud if args.baud != plain.baud else found.baud
    try:
        return replace(found, seed=seed, baud=baud)
    except ValueError as error:
        raise Problem(str(error)) from error


def scenario(args: argparse.Namespace) -> Scenario:
    """Make the scenario that the options ask for. Raises Problem."""
    try:
        pack = Pack(cells=args.cells, sensors=args.sensors, start_soc=args.soc, speed=args.pack_speed)
        habits = Habits(frame_base=args.frame_base, reserved=args.reserved, sensor_frames=args.sensor_frames)
        faults = tuple(args.fault)
        share = args.damage / 4
        return Scenario(
            seed=args.seed,
            baud=args.baud,
            boards=tuple(Board(number, pack, habits, args.asleep, faults) for number in sorted(set(args.boards))),
            host=Host(polls=args.host, address=args.host_address),
            damage=Damage(share, share, share, share),
        )
    except ValueError as error:
        raise Problem(str(error)) from error


def run(args: argparse.Namespace) -> int:
    """List, print, write a capture, or run the bus. Raises Problem."""
    if args.list:
        return _list()
    if args.example:
        sys.stdout.write(example_text())
        return 0
    made = chosen(args)
    if args.truth is not None:
        others = (args.output, args.scenario, args.replay)
        if os.path.realpath(args.truth) in {os.path.realpath(name) for name in others if name}:
            raise Problem(f"{args.truth} is named twice; name another file with --truth")
    if args.output:
        if args.replay:
            raise Problem("--replay plays a capture on the tap, and -w writes one: choose one of them")
        return _write(args, made)
    if (args.wire or made.wire) != "uart":
        raise Problem(f"a live bus is serial; a scenario on {args.wire or made.wire} goes to a capture: -w FILE")
    return _run_live(args, made)


def _list() -> int:
    found = ready_made()
    width = max(map(len, found))
    for name, one in found.items():
        story = f" [{one.story}]" if one.story else ""
        print(f"{name:<{width}}  {one.wire:<4}  {one.about}{story}")  # noqa: T201
    return 0


def _write(args: argparse.Namespace, made: Scenario) -> int:
    from dalytools.simulator.capture_file import write_capture

    wire = args.wire or made.wire
    seconds = args.duration or 0.0
    written = write_capture(
        made, args.output, wire=wire, seconds=seconds, file_format=args.file_format, truth=args.truth
    )
    where = "standard output" if args.output == "-" else args.output
    size = f", {counted(written.wire_bytes, 'byte')} on the wire" if wire == "uart" else ""  # of A5 and Modbus alone
    print(  # noqa: T201
        f"{where}: {counted(written.packets, 'packet')}{size} in {seconds or made.duration_s:g} s, as {wire}",
        file=sys.stderr,
    )
    return 0


def _run_live(args: argparse.Namespace, made: Scenario) -> int:
    """Run the bus until SIGINT, SIGTERM, the end of --duration or of the replay."""
    bus = SimulatedBus(
        made,
        truth=Truth(on=args.truth is not None),
        replay=args.replay,
        then_simulate=args.then_simulate,
        speed=args.speed,
        longest_silence_s=args.longest_silence,
        link=args.link,
    )

    def stop(_number: int, _frame: FrameType | None) -> None:
        bus.stop()

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        sys.stdout.write(f"tap: {bus.tap}\nclient: {bus.client}\n")
        sys.stdout.flush()
        bus.run(args.duration)
        bus.linger(_LINGER_S)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        bus.close()
    if args.truth is not None:
        with whole_file(str(args.truth)) as out:
            bus.bus.truth.write(out, made, wire="uart", end_ns=bus.ended_ns)
    if bus.problem:
        raise Problem(bus.problem)
    return 0
