# SPDX-License-Identifier: GPL-2.0-or-later
"""The launcher: the real tshark, our dissector, nothing of the user's, whoever starts it; else a line that says why."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import ASK, SAMPLES, dissector, open_folder, program, write

import dalytools.tshark
from dalytools.cli import main
from dalytools.problem import Problem
from dalytools.tshark import ORDINARY_USER, Tshark, find_tshark, lua_complaint

if TYPE_CHECKING:
    from collections.abc import Iterator

CYCLE = SAMPLES / "real-poll-cycle.pcapng"
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root has an ordinary user to become")
SOC = ("-T", "fields", "-e", "daly.soc")


@pytest.fixture
def place(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where temporary folders go, so that it can be seen whether they go away."""
    with open_folder() as folder:
        monkeypatch.setattr(tempfile, "tempdir", str(folder))
        yield folder


def refused() -> str:
    with pytest.raises(Problem) as caught, Tshark():
        pass
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_no_tshark(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], place: Path) -> None:
    monkeypatch.setenv("PATH", str(place))
    monkeypatch.delenv("DALYSHARK_TSHARK", raising=False)
    monkeypatch.setattr(dalytools.tshark, "_PLACES", ())
    for words in (["check", str(CYCLE)], ["watch"]):
        assert main(words) == 2
        shown = capsys.readouterr()
        assert shown.out == ""
        assert shown.err == (
            f"dalyshark {words[0]}: tshark, Wireshark's terminal program, is not installed; "
            "on Debian and Ubuntu: sudo apt install tshark (others: wireshark.org)\n"
        )
    assert list(place.iterdir()) == []


def test_the_variable_names_a_program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    text = tmp_path / "notes"
    text.write_text("mine", encoding="utf-8")
    for wrong in (text, tmp_path, tmp_path / "none", "no-such-tshark"):
        monkeypatch.setenv("DALYSHARK_TSHARK", str(wrong))
        with pytest.raises(Problem) as caught:
            find_tshark()
        assert str(caught.value) == f"DALYSHARK_TSHARK is {wrong}, which is not a program; name another, or unset it"
    monkeypatch.setenv("DALYSHARK_TSHARK", "tshark")
    assert Path(find_tshark()).is_absolute()


def test_a_program_that_cannot_run(monkeypatch: pytest.MonkeyPatch, place: Path) -> None:
    with open_folder() as folder:
        path = folder / "tshark"
        path.write_bytes(b"\x7fELF nothing behind it")
        path.chmod(0o755)
        monkeypatch.setenv("DALYSHARK_TSHARK", str(path))
        assert refused() == f"{path} does not start: Exec format error"
    assert list(place.iterdir()) == []


IGNORES = """
for word do shift; case "$word" in lua_script:*) word=lua_script1:x;; esac; set -- "$@" "$word"; done
exec REAL "$@"
"""


@pytest.mark.parametrize(
    ("script", "why"),
    [
        (IGNORES, "it ignores Lua scripts"),
        ("[ $1 = --version ] || exit 0\necho 'TShark (Wireshark) 9.9.9.'", "it ignores Lua scripts"),
        ("echo 'no Lua in here' >&2; exit 1", "no Lua in here"),
    ],
)
def test_a_tshark_without_lua(script: str, why: str, monkeypatch: pytest.MonkeyPatch, place: Path) -> None:
    with program(script) as path:
        monkeypatch.setenv("DALYSHARK_TSHARK", str(path))
        message = refused()
    assert f" does not load our dissector: {why}; is it built with Lua (tshark --version tells)?" in message
    assert message.startswith("tshark 9.9.9 " if "9.9.9" in script else "tshark ")
    assert list(place.iterdir()) == []


@pytest.mark.parametrize(
    ("pattern", "replacement", "why"),
    [
        (r'created, daly = pcall\(Proto, "daly"', r"local \g<0>", "syntax error"),
        (r'require\("daly_stat"\)', 'require("daly_none")', "not found"),
        (r"function daly\.dissector\(.*\)", r'\g<0> error("on purpose")', "on purpose"),
    ],
)
def test_a_dissector_that_breaks(
    pattern: str, replacement: str, why: str, monkeypatch: pytest.MonkeyPatch, place: Path
) -> None:
    with dissector((pattern, replacement)) as folder:
        monkeypatch.setattr(dalytools.tshark, "dissector_folder", lambda: folder)
        message = refused()
    assert message.startswith("our dissector breaks in tshark ")
    assert why in message
    assert [left for left in place.iterdir() if not left.name.startswith("dalyshark-test-")] == []


def test_a_dissector_that_is_not_there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(dalytools.tshark, "dissector_folder", lambda: tmp_path)
    assert refused() == f"the dissector is not where it should be: {tmp_path}; install dalyshark again"


def test_nothing_of_the_users_matters(monkeypatch: pytest.MonkeyPatch, place: Path) -> None:
    """A plugin of the same name, a preference and a profile in all the folders that a Wireshark looks at."""
    with open_folder() as home:
        for folder in (home / ".config" / "wireshark", home / ".wireshark", home / "wireshark"):
            (folder / "plugins").mkdir(parents=True)
            (folder / "preferences").write_text("daly.link_types: 150\ndaly.baud: 1\n", encoding="utf-8")
            (folder / "plugins" / "daly.lua").write_text('local p = Proto("daly", "Mine")', encoding="utf-8")
            (folder / "init.lua").write_text('error("mine")', encoding="utf-8")
        monkeypatch.setenv("HOME", str(home))
        monkeypatch.setenv("XDG_CONFIG_HOME", str(home))
        monkeypatch.setenv("WIRESHARK_CONFIG_DIR", str(home / "wireshark"))
        monkeypatch.setenv("WIRESHARK_PLUGIN_DIR", str(home / "wireshark" / "plugins"))
        monkeypatch.setenv("LC_ALL", "C")
        with Tshark() as tshark:
            done = tshark.run("-r", str(tshark.readable(CYCLE)), *SOC)
            assert tshark.home.parent == place
        assert (done.stdout.split(), done.stderr.count(b"mine")) == ([b"50"], 0)
        assert done.returncode == 0
        assert not tshark.home.exists()


def test_the_version_is_tsharks_own() -> None:
    with Tshark() as tshark:
        told = subprocess.run(["tshark", "--version"], capture_output=True, text=True, check=True).stdout
        assert f" {tshark.version} " in told.splitlines()[0].replace(".\n", " ") + " "
        assert tshark.version[0].isdigit()


@as_root
def test_root_starts_it_as_somebody_else(monkeypatch: pytest.MonkeyPatch) -> None:
    with program('[ "$1" = --who ] && { id -u; id -G; pwd; exit; }\nexec REAL "$@"') as path:
        monkeypatch.setenv("DALYSHARK_TSHARK", str(path))
        with Tshark() as tshark:
            who = tshark._run([str(path), "--who"]).stdout.split()  # pyright: ignore[reportPrivateUsage]
    assert who[:2] == [str(ORDINARY_USER).encode()] * 2


@as_root
def test_captures_that_root_alone_can_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Closed itself, in a closed folder, and open but reached by a relative way or a link through closed ones."""
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o700)
    secret = write(closed / "a b;$(id).pcapng", [(0.0, ASK)])
    secret.chmod(0o600)
    link = closed / "link"
    link.symlink_to(CYCLE)
    monkeypatch.chdir(closed)
    with Tshark() as tshark:
        for path, kinds in ((secret, 1), (Path(secret.name), 1), (link, 25), (Path(os.path.relpath(CYCLE)), 25)):
            readable = tshark.readable(path)
            done = tshark.run("-r", str(readable), "-T", "fields", "-e", "daly.kind")
            assert done.stdout.split() == [b"frame"] * kinds, (path, done.stderr)
        copies = tshark.readable(secret), tshark.readable(secret)
        assert copies[0] != copies[1]
        assert all(copy.parent == tshark.home for copy in copies)
    assert not any(copy.exists() for copy in copies)


@as_root
def test_a_clone_and_a_temporary_folder_that_root_alone_can_enter(tmp_path: Path) -> None:
    import shutil

    clone = tmp_path / "clone"
    clone.mkdir(mode=0o700)
    top = Path(__file__).parents[3]
    for folder in ("capture", "tools/dalyref", "tools/dalytools", "dissector", "pcap_samples"):
        shutil.copytree(top / folder, clone / folder, ignore=shutil.ignore_patterns("__pycache__"))
    code = (
        f"import sys; sys.path[:0] = [{str(clone / 'capture')!r}, {str(clone / 'tools')!r}]; import dalytools.tshark\n"
        f"assert dalytools.tshark.__file__.startswith({str(clone)!r})\n"
        "from dalytools.cli import entry; entry()"
    )
    (tmp_path / "temporary").mkdir(mode=0o700)
    done = subprocess.run(
        [sys.executable, "-c", code, "check", "pcap_samples/real-poll-cycle.pcapng"],
        cwd=clone,
        env={**os.environ, "TMPDIR": str(tmp_path / "temporary")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith(": 0 differences, 1 note\n")  # slot 15 of a pack of 14 cells


def test_what_counts_as_a_complaint_of_lua() -> None:
    assert lua_complaint("Running as user\n** (tshark) warning\n") is None
    assert lua_complaint("x\ntshark: Lua: syntax error: a.lua:1: oh\n") == "tshark: Lua: syntax error: a.lua:1: oh"
    assert lua_complaint("tshark: Lua: Error during loading:\n a.lua:1: oh\nstack") == (
        "tshark: Lua: Error during loading: a.lua:1: oh"
    )
