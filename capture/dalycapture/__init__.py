# SPDX-License-Identifier: GPL-2.0-or-later
"""The passive sniffer: port, records in time, capture file. It never writes to a port."""
