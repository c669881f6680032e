# SPDX-License-Identifier: GPL-2.0-or-later
"""One module a subcommand: ``add_arguments(parser)`` and ``run(args) -> exit status``."""
