# SPDX-License-Identifier: GPL-2.0-or-later
"""tools/setup.sh on machines that lack things: stand-ins for the system's programs, nothing is installed or fetched.

The machine is a folder of programs that is the whole PATH. Each stand-in writes what it was called with into `calls`.
"""

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PLAIN = (
    "sh",
    "dirname",
    "cat",
    "cksum",
    "tr",
    "sed",
    "grep",
    "mkdir",
    "chmod",
    "cp",
    "rm",
    "mktemp",
    "tail",
    "head",
    "env",
)
NOBODY_SPECIAL, SUPERUSER = "1000", "0"

# A Python of the wanted version; with a venv module or not; `-m venv` makes a folder with the same stand-in inside.
PYTHON = """
case "$*" in
*version_info*"< (3, 11)"*) exit {too_old} ;;
*"import venv"*) exit {no_venv} ;;
*version_info*) echo python3.11-venv ;;
"-m venv "*) mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
"-m pip --version") ;;
"-m pip "*install*) : >"${{0%/*}}/dalyshark" && chmod +x "${{0%/*}}/dalyshark" ;;
esac
"""


@dataclass
class Machine:
    """A made machine: `programs` is its PATH, `repository` a work tree with setup.sh in it."""

    programs: Path
    repository: Path

    def add(self, name: str, body: str = "") -> None:
        log = self.repository / "calls"
        # Started by no name on the PATH, as the interpreter line is read by the kernel.
        (self.programs / name).write_text(f'#!/bin/sh\necho "{name} $*" >>"{log}"\n{body}\n', encoding="utf-8")
        (self.programs / name).chmod(0o755)

    def setup(self, want: str) -> subprocess.CompletedProcess[str]:
        (self.repository / "calls").unlink(missing_ok=True)
        return subprocess.run(
            ["/bin/sh", self.repository / "tools" / "setup.sh", want],
            env={"PATH": str(self.programs), "HOME": str(self.repository), "TMPDIR": str(self.repository)},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )

    def calls(self) -> list[str]:
        log = self.repository / "calls"
        return log.read_text(encoding="utf-8").splitlines() if log.exists() else []


def python(*, too_old: bool = False, no_venv: bool = False) -> str:
    return PYTHON.format(too_old=int(too_old), no_venv=int(no_venv))


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    """Debian with Python and its venv module, apt-get, no tshark, and an ordinary user without sudo."""
    made = Machine(tmp_path / "programs", tmp_path / "repository")
    made.programs.mkdir()
    for name in PLAIN:
        found = shutil.which(name)
        assert found, name
        (made.programs / name).symlink_to(found)
    for part in ("tools/setup.sh", "tools/node/package.json", "tools/node/package-lock.json", "pyproject.toml"):
        (made.repository / part).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / part, made.repository / part)
    made.add("python3", python())
    made.add("id", f"echo {NOBODY_SPECIAL}")
    made.add("apt-get")
    return made


def said(run: subprocess.CompletedProcess[str]) -> list[str]:
    assert run.stdout == ""
    return run.stderr.splitlines()


def test_who_may_not_install_is_told_what_to_type(machine: Machine) -> None:
    machine.add("python3", python(no_venv=True))
    run = machine.setup("run")
    assert run.returncode == 2
    line = "setup: needs system packages: type  sudo apt-get install python3.11-venv tshark  then do it again"
    assert said(run) == [line]
    assert not any(call.startswith("apt-get") for call in machine.calls())


def test_tests_need_more(machine: Machine) -> None:
    machine.add("tshark")
    run = machine.setup("dev")
    assert run.returncode == 2
    [line] = said(run)
    assert "install lua-check lua5.2 lua5.4 strace tmux chromium  then" in line


def test_another_system_is_told_the_packages(machine: Machine) -> None:
    (machine.programs / "apt-get").unlink()
    run = machine.setup("run")
    assert run.returncode == 2
    [line] = said(run)
    assert line.startswith("setup: needs tshark (Debian's names)")


def test_root_installs_without_a_question_and_fetches_the_list_only_when_needed(machine: Machine) -> None:
    machine.add("id", f"echo {SUPERUSER}")
    appear = f'case "$*" in *install*) echo "$DEBIAN_FRONTEND" >>calls; cp "$0" {machine.programs}/tshark ;; esac'
    machine.add("apt-get", appear)
    run = machine.setup("run")
    assert run.returncode == 0, run.stderr
    calls = machine.calls()
    assert [call for call in calls if call.startswith("apt-get")] == [
        "apt-get install -qq --yes --no-install-recommends tshark"
    ]
    assert "noninteractive" in calls


def test_root_fetches_the_list_when_installing_fails(machine: Machine) -> None:
    machine.add("id", f"echo {SUPERUSER}")
    machine.add("apt-get", 'case "$*" in *install*) echo "E: Unable to locate package tshark" >&2; exit 100 ;; esac')
    run = machine.setup("run")
    assert run.returncode == 2
    assert "apt-get could not install tshark: Unable to locate package tshark" in said(run)[-1]
    words = [call.split()[1] for call in machine.calls() if call.startswith("apt-get")]
    assert words == ["install", "update", "install"]


def test_an_old_python_is_not_taken(machine: Machine) -> None:
    machine.add("python3", python(too_old=True))
    run = machine.setup("run")
    assert run.returncode == 2
    assert "install python3 python3-venv tshark  then" in said(run)[0]


def pip_installs(machine: Machine) -> list[str]:
    return [call for call in machine.calls() if "-m pip" in call and "install" in call]


def test_a_second_run_does_nothing_until_something_changed(machine: Machine) -> None:
    machine.add("tshark")
    assert machine.setup("run").returncode == 0
    assert (machine.repository / ".venv" / "bin" / "dalyshark").exists()
    assert len(pip_installs(machine)) >= 1

    again = machine.setup("run")
    assert (again.returncode, again.stderr) == (0, "")
    assert pip_installs(machine) == []

    with (machine.repository / "pyproject.toml").open("a", encoding="utf-8") as file:
        file.write("# a dependency more\n")
    assert machine.setup("run").returncode == 0
    assert len(pip_installs(machine)) >= 1


def test_a_moved_work_tree_gets_a_new_environment(machine: Machine, tmp_path: Path) -> None:
    machine.add("tshark")
    assert machine.setup("run").returncode == 0
    moved = tmp_path / "elsewhere"
    machine.repository.rename(moved)
    there = Machine(machine.programs, moved)
    there.add("python3", python())
    assert said(there.setup("run"))[0] == "setup: making .venv"


@pytest.mark.parametrize("shell", ["sh", "bash", "dash"])
def test_plain_shell(shell: str) -> None:
    """Each shell script parses in each shell that /bin/sh may be."""
    program = shutil.which(shell)
    if program is None:
        pytest.fail(f"{shell} is part of every Debian")
    for script in (ROOT / "tools" / "setup.sh", ROOT / "tools" / "lint.sh", ROOT / "tests/matrix/make_wireshark.sh"):
        subprocess.run([program, "-n", script], check=True, env=dict(os.environ))
