# SPDX-License-Identifier: GPL-2.0-or-later
"""What docs/ci.md shows runs: the shell example as it stands, the workflow's check step, the configuration."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/ci.md").read_text("utf-8")
WORKFLOW = (ROOT / "docs/ci/dalyshark.yml").read_text("utf-8")
SAMPLES = ROOT / "pcap_samples"


def example(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    assert found
    return found[1]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "captures").mkdir()
    shutil.copy(SAMPLES / "made-poll-cycle.pcapng", tmp_path / "captures/good.pcapng")
    shutil.copy(SAMPLES / "made-faults.pcapng", tmp_path / "captures/faults.pcapng")
    return tmp_path


def shell(text: str, folder: Path) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    return subprocess.run(
        ["/bin/sh", "-c", text],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_the_shell_example_runs(project: Path) -> None:
    done = shell(example("sh"), project)
    assert done.returncode == 0, done.stderr
    assert ET.parse(project / "result.xml").getroot().tag == "testsuites"  # our own file


def test_the_workflows_check_step_runs(project: Path) -> None:
    (step,) = re.findall(r"run: (dalyshark check .*)", WORKFLOW)
    done = shell(step, project)
    assert done.returncode == 0, done.stderr
    assert "::warning" not in done.stdout  # faults are ignored in it
    failing = shell(step.replace("--ignore fault-raised ", ""), project)
    assert failing.returncode == 1
    assert "::warning" in failing.stdout
    assert (project / "dalyshark.xml").exists()


def test_the_configuration_is_read(project: Path) -> None:
    (project / "dalyshark.toml").write_text(example("toml"))
    done = shell("dalyshark check captures/faults.pcapng", project)
    assert done.returncode == 0, done.stderr + done.stdout
    assert "dalyshark.toml" in done.stderr
    (project / "dalyshark.toml").write_text(example("toml").replace("fault-raised", "fault-rased"))
    assert shell("dalyshark check captures/faults.pcapng", project).returncode == 2
