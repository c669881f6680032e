# SPDX-License-Identifier: GPL-2.0-or-later
"""The dissector loads from wherever people put it, and says what it knows."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from dalytools.field_names import FIELD_NAMES, VIEW_NAMES
from dalytools.tshark import dissector_folder

if TYPE_CHECKING:
    from dalytools.tshark import Tshark

SAMPLE = Path(__file__).resolve().parents[2] / "pcap_samples" / "real-poll-cycle.pcapng"
WORDS = ["-T", "fields", "-e", "daly.kind"]


def plain(tshark: Tshark, words: list[str], **more: Any) -> subprocess.CompletedProcess[bytes]:
    """Run this tshark without the launcher's own -X."""
    process = tshark.start_program(
        [tshark.program, "-n", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, **more
    )
    out, messages = process.communicate(timeout=60)
    return subprocess.CompletedProcess([], process.returncode, out, messages)


def copy_lua(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for file in dissector_folder().glob("*.lua"):
        shutil.copyfile(file, folder / file.name)
        (folder / file.name).chmod(0o644)
    for above in (folder, *folder.parents[:3]):
        if above.stat().st_mode & 0o77 != 0o55 and str(above).count("/") > 1:
            above.chmod(0o755)


@pytest.mark.parametrize("cwd", ["/", "folder"])
@pytest.mark.parametrize("relative", [False, True])
def test_by_x_from_any_folder(tshark: Tshark, open_folder: Path, cwd: str, relative: bool) -> None:
    copy_lua(open_folder / "lua")
    here = Path("/") if cwd == "/" else open_folder
    script = open_folder / "lua" / "daly.lua"
    name = str(script.relative_to(here)) if relative else str(script)
    done = plain(tshark, ["-X", f"lua_script:{name}", "-r", str(tshark.readable(SAMPLE)), *WORDS], cwd=here)
    assert done.stdout.split().count(b"frame") == 25, done.stderr


@pytest.mark.parametrize("place", [".local/lib/wireshark/plugins", ".local/lib/wireshark/plugins/daly"])
def test_from_the_personal_plugin_folder(tshark: Tshark, open_folder: Path, place: str) -> None:
    copy_lua(open_folder / place)
    environment = {"HOME": str(open_folder), "XDG_CONFIG_HOME": str(open_folder / ".config")}
    words = ["-r", str(tshark.readable(SAMPLE)), *WORDS]
    done = plain(tshark, words, environment=environment)
    assert done.stdout.split().count(b"frame") == 25, done.stderr
    # And given a second time by -X: the first one serves, without a complaint.
    twice = plain(tshark, ["-X", f"lua_script:{open_folder / place / 'daly.lua'}", *words], environment=environment)
    assert twice.stdout.split().count(b"frame") == 25
    assert b"Lua" not in twice.stderr


def test_from_the_global_plugin_folder(tshark: Tshark, open_folder: Path) -> None:
    copy_lua(open_folder / "plugins")
    done = plain(
        tshark,
        ["-r", str(tshark.readable(SAMPLE)), *WORDS],
        environment={"HOME": str(open_folder), "WIRESHARK_PLUGIN_DIR": str(open_folder / "plugins")},
    )
    assert done.stdout.split().count(b"frame") == 25, done.stderr


def test_an_empty_capture_loads_without_a_word(tshark: Tshark) -> None:
    path = tshark.home / "empty.pcap"
    path.write_bytes(bytes.fromhex("d4c3b2a1020004000000000000000000ffff000093000000"))
    path.chmod(0o644)
    done = tshark.run("-r", str(path))
    assert (done.returncode, done.stdout) == (0, b"")
    assert b"Lua" not in done.stderr


def test_every_field_is_there_and_described(tshark: Tshark) -> None:
    listed = {name: description for _, name, kind, description in tshark.fields() if kind != "FT_NONE"}
    assert set(listed) == {*FIELD_NAMES, *VIEW_NAMES}
    assert [name for name, description in listed.items() if not description.strip()] == []


def test_names_of_files_fit_every_version() -> None:
    """No dot besides .lua (4.4 and later), prefixes of our own (modules are shared by all plugins), no folders."""
    names = [path.name for path in dissector_folder().rglob("*.lua")]
    assert "daly.lua" in names
    assert all(name.count(".") == 1 and name.startswith("daly") for name in names)
    assert len(names) == len(list(dissector_folder().glob("*.lua")))
