# SPDX-License-Identifier: GPL-2.0-or-later
"""The example in docs/scapy.md runs, and both readings agree on what it makes."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from dalytools.comparison import compare
from dalytools.tshark import Tshark

ROOT = Path(__file__).parents[2]


def test_the_example_runs(tmp_path: Path) -> None:
    found = re.search(r"```python\n(.*?)```", (ROOT / "docs/scapy.md").read_text("utf-8"), re.DOTALL)
    assert found
    subprocess.run([sys.executable, "-c", found[1]], cwd=tmp_path, check=True)
    with Tshark() as tshark:
        result = compare(tshark, tmp_path / "crafted.pcap")
    assert (result.records, result.found) == (4, 0)
    assert result.kinds == {"frame": 3, "bad_checksum": 1}
