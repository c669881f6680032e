# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark survey``: what moves in traffic that nobody documented.

records -> places (place, units) -> each a stream (stream) -+-> moves: values, steps, bits, carries of every byte
+-> mirrors: equal to what another frame holds
+-> samples: runs of payloads with known quantities
streams -> claims (findings) -> terminal (listing), page, JSON; two surveys -> difference
"""
