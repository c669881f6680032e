# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark check``: exit status, tables, JSON, JUnit, annotations, settings, baselines."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import xmlschema
from tests.meaning import a5
from tests.tools.dalytools.findings.injected import CASES, CLEAN, LATER, Heard, asked, capture
from tests.tools.dalytools.made import SAMPLES

from dalytools.cli import main
from dalytools.findings import table
from dalytools.findings.rules import RULES

if TYPE_CHECKING:
    from collections.abc import Sequence

SCHEMA = Path(__file__).with_name("junit.xsd")
EVIL = "\x1b]0;owned\x07]]>\r\n::error::<b>%0A,a:b\ud800\uffff"


@pytest.fixture(autouse=True)
def elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No dalyshark.toml but the test's."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def clean(tmp_path: Path) -> str:
    return str(capture(tmp_path / "clean.pcapng", [*CLEAN, *LATER]))


@pytest.fixture
def silent(tmp_path: Path) -> str:
    return str(capture(tmp_path / "silent.pcapng", [*CASES["silent"], *LATER]))


def check(*words: str) -> int:
    return main(["check", "--no-dissector", *words])


def test_status_is_that_of_the_worst_finding(clean: str, tmp_path: Path) -> None:
    echo = str(capture(tmp_path / "echo.pcapng", [*CASES["echo"], *LATER]))
    write = str(capture(tmp_path / "write.pcapng", [*CASES["write"], *LATER]))
    wrong = str(capture(tmp_path / "wrong.pcapng", [*CASES["wrong-board"], *LATER]))
    for path, statuses in ((clean, (0, 0, 0, 0)), (write, (1, 0, 0, 0)), (echo, (1, 1, 0, 0)), (wrong, (1, 1, 1, 0))):
        for fail_on, status in zip(("note", "warning", "error", "never"), statuses, strict=True):
            assert check(path, "--fail-on", fail_on) == status, (path, fail_on)
    assert check(clean) == check(echo) == 0
    assert check(clean, wrong) == 1
    assert check(wrong, str(tmp_path / "none.pcapng")) == 2


def test_with_the_dissector(silent: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", silent, str(SAMPLES / "real-poll-cycle.pcapng")]) == 1
    lines = capsys.readouterr().out.splitlines()
    head, total = lines[0], lines[-1]
    (clean,) = (line for line in lines if line.startswith(str(SAMPLES)))
    assert head == f"{silent}: 5 records (5 frame): 0 differences, 1 error, 1 warning"
    assert clean.endswith("real-poll-cycle.pcapng: 25 records (25 frame): 0 differences, 1 note")  # cell 15 of 14
    assert total.startswith("2 files, 30 records, tshark ")
    assert total.endswith(": 0 differences, 1 error, 1 warning, 1 note")


def test_no_sample_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert check(*(str(path) for path in sorted(SAMPLES.glob("*.pcap*")))) == 0
    assert capsys.readouterr().err == ""


def test_for_people(clean: str, silent: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert check(silent, clean) == 1
    shown = capsys.readouterr().out
    first, header, worst, *_ = shown.splitlines()
    assert first == f"{silent}: 5 records (5 frame): 1 error, 1 warning"
    assert header.split() == ["severity", "rule", "where", "when", "what,", "and", "what", "to", "do"]
    assert worst.split()[:4] == ["error", "silent", "board", "2"]
    assert "1 .. 3" in worst
    assert f"{clean}: 35 records (35 frame): nothing found" in shown
    assert shown.splitlines()[-1] == "2 files, 40 records: 1 error, 1 warning"
    assert "\x1b" not in shown
    assert max(map(len, shown.splitlines()[1:])) <= 120
    assert check("-q", silent, clean) == 1
    quiet = capsys.readouterr().out
    assert "unanswered" not in quiet
    assert clean not in quiet


def test_a_hostile_number_of_findings_is_not_listed(
    silent: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table, "MOST_SHOWN", 1)
    assert check(silent) == 1
    shown = capsys.readouterr().out
    assert "silent" in shown
    assert "unanswered" not in shown
    assert "and 1 more finding; --json FILE has all of them" in shown


def test_rules_are_listed(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "dalyshark.toml").write_text('[check.severity]\nwrite = "error"\n', encoding="utf-8")
    assert main(["check", "--rules", "--ignore", "echo"]) == 0
    shown = capsys.readouterr().out
    listed = {words[0]: words[1] for line in shown.splitlines() if (words := line.split()) and words[0] in RULES}
    assert listed == {rule.name: str(rule.severity) for rule in RULES.values()} | {"echo": "ignored", "write": "error"}


def test_ignored_rules_do_not_count(silent: str) -> None:
    assert check(silent, "--ignore", "silent") == 0
    assert check(silent, "--ignore", "silent", "--fail-on", "warning") == 1
    assert check(silent, "--ignore", "silent", "--ignore", "unanswered", "--fail-on", "note") == 0


def test_json(silent: str, clean: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert check(silent, clean, "--json", "-") == 1
    shown = capsys.readouterr()
    document: dict[str, Any] = json.loads(shown.out)
    assert "board 2" in shown.err  # the table for people
    assert (document["format"], document["version"], document["status"]) == ("dalyshark check", 1, 1)
    assert [file["file"] for file in document["files"]] == [silent, clean]
    assert [file["records"] for file in document["files"]] == [5, 35]
    worst = document["files"][0]["findings"][0]
    assert {name: worst[name] for name in ("rule", "severity", "where", "board", "count", "first_packet")} == {
        "rule": "silent",
        "severity": "error",
        "where": "board 2",
        "board": 2,
        "count": 3,
        "first_packet": 1,
    }
    assert worst["first_time"] == "2023-11-14T22:13:20.000000000Z"  # 1 700 000 000 s
    assert worst["last_time"] == "2023-11-14T22:13:24.000000000Z"
    assert check(silent, "--json", "out.json") == 1
    assert json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["files"][0]["findings"][0] == worst


def junit(path: Path) -> ET.Element:
    xmlschema.XMLSchema(SCHEMA).validate(path)  # pyright: ignore[reportUnknownMemberType]
    return ET.parse(path).getroot()


def verdicts(suite: ET.Element, kind: str) -> list[str]:
    return [case.attrib["name"] for case in suite.iter("testcase") if case.find(kind) is not None]


def test_junit(silent: str, clean: str, tmp_path: Path) -> None:
    out = tmp_path / "junit.xml"
    none = str(tmp_path / "none.pcapng")
    assert check(silent, clean, none, "--junit", str(out), "--ignore", "echo") == 2
    bad, good, missing = junit(out)
    assert [suite.attrib["name"] for suite in (bad, good, missing)] == [silent, clean, none]
    names = [case.attrib["name"] for case in good.iter("testcase")]
    assert names == [name for name in RULES if name not in ("echo", "dissector-differs")]
    assert (bad.attrib["tests"], bad.attrib["failures"], bad.attrib["errors"]) == (str(len(names)), "1", "0")
    assert verdicts(bad, "failure") == ["silent"]
    assert "unanswered" in (bad.findtext("system-out") or "")
    assert verdicts(good, "failure") == verdicts(good, "error") == []
    assert (missing.attrib["tests"], missing.attrib["errors"]) == ("1", "1")
    assert verdicts(missing, "error") == ["read"]


@pytest.mark.parametrize("rule", CASES)
def test_junit_is_valid_whatever_was_found(rule: str, tmp_path: Path) -> None:
    path = capture(tmp_path / "case.pcapng", [*CASES[rule], *LATER], (f"dalyshark bus=a {EVIL}", f"bus=b{EVIL}"))
    out = tmp_path / "junit.xml"
    assert check(str(path), "--junit", str(out), "--fail-on", "note") == 1
    assert rule in verdicts(junit(out)[0], "failure")


def commands(out: str) -> list[str]:
    return [line for line in out.splitlines() if line.startswith("::")]


def test_annotations_are_escaped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """GitHub's rule: % as %25, line ends as %0D and %0A, and in a property : as %3A and , as %2C."""
    name = "50% a,b:c\n::stop-commands::x.pcapng"
    lost = Heard(5, comment=f"port lost: 100 % of it\r\n::warning::gone {EVIL[:8]}")
    path = capture(tmp_path / name, [*CLEAN, lost, *LATER])
    assert check(str(path), "--github") == 0
    (line,) = commands(capsys.readouterr().out)
    folder = str(tmp_path).replace(":", "%3A")
    assert line == (
        f"::warning file={folder}/50%25 a%2Cb%3Ac\\n%3A%3Astop-commands%3A%3Ax.pcapng,title=port-lost%3A the capture::"
        "1 time (packet 34)%0A"
        "packet 34: port lost: 100 %25 of it\\r\\n::warning::gone \\x1b]0;owne%0A"
        f"{RULES['port-lost'].advice}"
    )


def test_annotations_of_each_severity(silent: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write = str(capture(tmp_path / "write.pcapng", [*CASES["write"], *LATER]))
    assert check(silent, write, str(tmp_path / "none"), "--github", "-q") == 2
    heads = [line.split(" ", 1)[0] for line in commands(capsys.readouterr().out)]
    assert heads == ["::error", "::warning", "::notice", "::error"]


def test_settings_from_a_file(silent: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    config = tmp_path / "dalyshark.toml"
    config.write_text('[check]\nignore = ["silent"]\nfail-on = "warning"\n', encoding="utf-8")
    assert check(silent) == 1
    assert capsys.readouterr().err == "dalyshark check: settings from dalyshark.toml\n"
    assert check(silent, "--fail-on", "error") == 0  # the command line goes first
    config.write_text('[check.severity]\nsilent = "note"\n[wire]\nreply = 0.5\nbaud = 19200\n', encoding="utf-8")
    assert check(silent) == 0
    config.unlink()
    beside = tmp_path / "captures"
    beside.mkdir()
    Path(silent).rename(beside / "silent.pcapng")
    (beside / "dalyshark.toml").write_text('[check]\nignore = ["silent"]\n', encoding="utf-8")
    assert check("captures/silent.pcapng") == 0
    assert capsys.readouterr().err.endswith("settings from captures/dalyshark.toml\n")


def test_limits_and_constants_from_a_file(tmp_path: Path) -> None:
    path = str(capture(tmp_path / "slow.pcapng", [*CLEAN, *asked(5, 0x90, CLEAN[1].data, after=0.3), *LATER]))
    config = tmp_path / "limits.toml"
    config.write_text("[check]\nlate-after = 0.2\n", encoding="utf-8")
    assert check(path, "--fail-on", "note") == 0
    assert check(path, "--fail-on", "note", "--config", str(config)) == 1
    assert check(path, "--fail-on", "note", "--config", str(config), "--late-after", "0.4") == 0
    config.write_text("[wire]\nreply = 0.2\n", encoding="utf-8")
    assert check(path, "--fail-on", "note", "--config", str(config)) == 1
    assert check(path, "--fail-on", "note", "--config", str(config), "--reply", "1") == 0


BROKEN: Sequence[tuple[str, str]] = (
    ('[check]\nfail_on = "error"\n', "check.fail_on is not known"),
    ("[checks]\n", "checks is not known"),
    ('[check]\nignore = ["echoes"]\n', "check.ignore is 'echoes', and must be one of "),
    ('[check]\nignore = "echo"\n', "check.ignore must be a list"),
    ('[check]\nfail-on = "fatal"\n', "check.fail-on is 'fatal', and must be one of note, warning, error, never"),
    ('[check.severity]\nechos = "note"\n', "check.severity.echos is not known (see dalyshark check --rules)"),
    ("[check]\nlate-after = true\n", "check.late-after is True, and must be a number from 0 up"),
    ("[wire]\nbaud = 9600.5\n", "wire.baud: '9600.5' is no baud rate"),
    ("[wire]\ntcp-ports = 70000\n", "wire.tcp-ports: '70000' is no list of numbers from 1 to 65535; 8899 and "),
    (
        '[wire]\nble-handles = [0x11, "zz"]\n',
        "wire.ble-handles: '17,zz' is no list of numbers from 1 to 65535; 17 and ",
    ),
    ("[wire]\nble-handles = 1.5\n", "wire.ble-handles: '?' is no list"),
    ("[wire]\ntcp-ports = [true]\n", "wire.tcp-ports: 'True' is no list"),
    ("[wire]\ntcp_ports = 1\n", "wire.tcp_ports is not known"),
    ("[check\n", "(at line 1"),
    ("check = 3\n", "check must be a table"),
    ("\x00", "line 1"),
)


@pytest.mark.parametrize(("text", "says"), BROKEN)
def test_settings_that_are_wrong_are_one_line(
    text: str, says: str, clean: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "wrong.toml"
    config.write_text(text, encoding="utf-8")
    assert check(clean, "--config", str(config)) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith(f"dalyshark check: {config}: ")
    assert says in shown.err
    assert shown.err.count("\n") == 1


def test_settings_that_are_not_there(clean: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert check(clean, "--config", "none.toml") == 2
    assert capsys.readouterr().err == "dalyshark check: none.toml: can not be read: no such file or directory\n"


@pytest.mark.parametrize("form", ["capture", "json"])
def test_against_a_baseline_only_what_is_new_counts(
    form: str, silent: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = silent
    if form == "json":
        old = "old.json"
        assert check(silent, "--json", old) == 1
    assert check("--baseline", old, silent, "--fail-on", "note") == 0
    assert capsys.readouterr().out.splitlines()[-1] == "1 file, 5 records: 2 known before"
    more = [*CASES["silent"], *(Heard(30.0 + 2 * number, a5(0x42, 0x90)) for number in range(3)), Heard(50)]
    new = str(capture(tmp_path / "new.pcapng", more))
    assert check("--baseline", old, new) == 1
    shown = capsys.readouterr().out
    assert "board 3" in shown
    assert "board 2" not in shown.replace("board 2 answers", "")


def test_a_baseline_that_is_none(silent: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, text in (("a.json", '{"a": 1}'), ("b.json", '{"format": "dalyshark check"'), ("c.json", "{" * 5000)):
        (tmp_path / name).write_text(text, encoding="utf-8")
        assert check("--baseline", name, silent) == 2
        assert capsys.readouterr().err.startswith(
            f"dalyshark check: {name} is not the JSON of an earlier check; make one"
        )
    assert check("--baseline", "none", silent) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_unusable_command_lines(silent: str, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (
        [],
        [silent, "--json", "-", "--junit", "-"],
        [silent, "--json", silent],
        [silent, "--junit", "none/there.xml"],
    ):
        assert check(*words) == 2
        assert capsys.readouterr().err.count("\n") == 1
    for words in ([silent, "--ignore", "echoes"], [silent, "--late-after", "-1"], [silent, "--fail-on", "fatal"]):
        with pytest.raises(SystemExit) as end:
            check(*words)
        assert end.value.code == 2


def test_what_a_capture_says_cannot_steer_a_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = capture(tmp_path / "evil.pcapng", [*CLEAN, Heard(5, comment=f"port lost {EVIL}"), *LATER])
    assert check(str(path)) == 0
    shown = capsys.readouterr().out
    assert "owned" in shown
    assert all(character.isprintable() or character == "\n" for character in shown)


def test_colour_can_be_switched_off(silent: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import io

    from dalytools.findings.table import console

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    def coloured(colour: bool | None = None) -> bool:
        out = Terminal()
        to = console(out, colour=colour)
        to.print("x", style="red")
        return "\x1b" in out.getvalue()

    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert coloured()
    assert not coloured(colour=False)
    monkeypatch.setenv("NO_COLOR", "1")
    assert not coloured()
