# SPDX-License-Identifier: GPL-2.0-or-later
"""Decoded records as tables: CSV and Parquet (docs/exports.md)."""
