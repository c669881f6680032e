# SPDX-License-Identifier: GPL-2.0-or-later
"""Measurements and long campaigns; ``make bench`` and ``make soak``."""
