# SPDX-License-Identifier: GPL-2.0-or-later
"""Long captures as columns, quickly; the values are the reference decoder's (docs/bulk.md). Needs numpy."""
