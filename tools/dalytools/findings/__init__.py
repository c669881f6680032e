# SPDX-License-Identifier: GPL-2.0-or-later
"""What went wrong on a bus, found in the decoded records: the rules of the protocol, as findings for people and for CI.

records --> watches (one a family of rules) --> findings --> table, JSON, JUnit, annotations
"""
