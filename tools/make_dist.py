# SPDX-License-Identifier: GPL-2.0-or-later
"""``make dist``: the dissector as one file, and a zip of it with the profile, for people without Python.

    dist/dalyshark.lua
    dist/dalyshark-VERSION-wireshark.zip    dalyshark.lua, profile/Daly BMS/..., INSTALL.txt

The same tree gives the same bytes.
"""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

from dalytools import __version__
from dalytools.bundle import NAME, bundle
from dalytools.installation import PROFILE

ROOT = Path(__file__).resolve().parents[1]

_INSTALL = """\
dalyshark {version}: Daly BMS in Wireshark

1. Wireshark: Help, About Wireshark, Folders. Copy dalyshark.lua into "Personal Lua Plugins".
2. Copy the folder "profile/Daly BMS" into the folder "profiles" of "Personal configuration".
3. Start Wireshark again. Choose the profile "Daly BMS" at the lower right (4.4 and later choose it by themselves).
To check: tshark -G protocols | grep -i daly
"""


def main() -> int:
    """Write both files."""
    out = ROOT / "dist"
    out.mkdir(exist_ok=True)
    text = bundle(ROOT / "dissector").encode()
    (out / NAME).write_bytes(text)
    files = {NAME: text, "INSTALL.txt": _INSTALL.format(version=__version__).encode()}
    for file in sorted((ROOT / "dissector" / "profile").iterdir()):
        files[f"profile/{PROFILE}/{file.name}"] = file.read_bytes()
    archive = out / f"dalyshark-{__version__}-wireshark.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in files.items():
            packed.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content)
    sys.stdout.write(f"dist/{NAME}\ndist/{archive.name}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
