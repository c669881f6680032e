# SPDX-License-Identifier: GPL-2.0-or-later
"""Findings are neither missed nor invented: every fault that a scenario injects is found, and nothing else is."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalyref.real import ROWS
from tests.tools.dalytools.findings.injected import Heard, capture, search
from tests.tools.dalytools.findings.recall import FOUND_BY, judge

from dalytools.findings.finding import Severity
from dalytools.simulator.scenario_file import ready_made
from dalytools.simulator.truth import KINDS

if TYPE_CHECKING:
    from pathlib import Path

    from dalytools.simulator.scenario import Scenario

SEEDS = {"uart": (1, 7), "can": (1,)}
NOT_FOUND_BY_A_RULE = {"fault_set", "fault_unset", "fault_cleared", "asleep", "awake"}
"""In the board, not yet on the wire; said in the text of another finding; or found by what follows from it."""


def scenario(name: str, seed: int) -> Scenario:
    return dataclasses.replace(ready_made()[name], seed=seed)


def wires(name: str) -> list[str]:
    """Whatever a scenario is made for; and CAN, where it is all A5."""
    made = ready_made()[name]
    own = "can" if made.wire == "can" else "uart"
    return [own] if own == "can" or any(host.dialect != "a5" for host in made.hosts) else [own, "can"]


def test_every_kind_of_fault_has_a_rule() -> None:
    assert set(FOUND_BY) | NOT_FOUND_BY_A_RULE == set(KINDS)


@pytest.mark.parametrize("name", list(ready_made()))
def test_what_was_injected_is_found_and_no_more(name: str, tmp_path: Path) -> None:
    for wire in wires(name):
        for seed in SEEDS["can" if wire == "can" else "uart"]:
            judged = judge(scenario(name, seed), tmp_path / f"{wire}{seed}.pcapng", wire=wire)
            assert judged.missed == [], (wire, seed)
            assert judged.invented == [], (wire, seed)
            if name.startswith("clean-"):
                assert [found for found in judged.findings if found.severity > Severity.NOTE] == []


def test_what_is_put_in_is_seen_to_be_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The comparison itself: with one rule's moments taken away, or one note, it says so."""
    made = scenario("faults", 1)
    whole = judge(made, tmp_path / "whole.pcapng")
    assert len(whole.notes) == 4
    monkeypatch.setitem(FOUND_BY, "fault_raised", FOUND_BY["fault_present"])
    assert len(judge(made, tmp_path / "less.pcapng").missed) == 4


SESSIONS: dict[str, list[str]] = {}
"""What is there of one source, in the order of the file: the frames of a bus as far as they were published."""
for row in ROWS:
    if row["transport"] != "can" and row.get("kind") != "corrupt" and not row.get("synthetic"):
        SESSIONS.setdefault(row["id"].partition("-")[0], []).append(row["hex"])


@pytest.mark.parametrize("name", SESSIONS)
def test_real_sessions_are_no_errors(name: str, tmp_path: Path) -> None:
    packets = [Heard(number / 5, data) for number, data in enumerate(SESSIONS[name])]
    found = search(capture(tmp_path / "real.pcapng", [*packets, Heard(100)]))
    assert [finding for finding in found if finding.severity is Severity.ERROR] == []
