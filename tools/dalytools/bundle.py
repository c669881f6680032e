# SPDX-License-Identifier: GPL-2.0-or-later
"""The dissector as one file, for dropping into Wireshark's plugin folder: ``dalyshark.lua``.

    head: what it is, how to install it
    package.preload["daly_fields"] = function(...) <daly_fields.lua> end      each module, by name
    ...
    <daly.lua>

The same modules give the same bytes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalytools import __version__

if TYPE_CHECKING:
    from pathlib import Path

NAME: Final = "dalyshark.lua"
ENTRY: Final = "daly.lua"

_HEAD: Final = """\
-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- dalyshark {version}: Daly BMS in Wireshark and tshark, in one file
--
-- To install: put this file into Wireshark's personal Lua plugins folder (Help, About Wireshark, Folders), or run
--     tshark -X lua_script:dalyshark.lua -r capture.pcapng
-- To check:   tshark -G protocols | grep -i daly        (not as root: 4.2 and later load no plugins then)
"""


def bundle(folder: Path) -> str:
    """Return the text of the one file, of the modules in a folder. Raises FileNotFoundError where there is no entry."""
    parts = [_HEAD.format(version=__version__)]
    for module in sorted(folder.glob("daly_*.lua")):
        source = module.read_text(encoding="utf-8")
        parts.append(f'package.preload["{module.stem}"] = function(...)\n{source}end\n')
    parts.append((folder / ENTRY).read_text(encoding="utf-8"))
    return "\n".join(parts)
