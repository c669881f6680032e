# SPDX-License-Identifier: GPL-2.0-or-later
"""A page to look at: ``dalyshark report``.

decoded records --collect--> what a page shows, in bounded memory --figures--> plots --page--> one HTML file
"""
