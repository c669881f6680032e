# SPDX-License-Identifier: GPL-2.0-or-later
"""A copy of a capture that can be shown to others: what tells whose battery it is, and where, is blanked."""
