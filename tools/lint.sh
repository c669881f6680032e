#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
#
# All checks that need no run of the programs; --write formats instead. Runs all of them, and fails if one did.
set -u

cd "$(dirname "$0")/.." || exit
PATH=$PWD/.venv/bin:$PATH
failed=''

step() {
    name=$1
    shift
    "$@" || failed="$failed $name"
}

# Lua files, of which there may be none in a folder.
lua=$(find dissector tests -name '*.lua' | LC_ALL=C sort)

# shellcheck disable=SC2086 # one word is one file
if [ "${1:-}" = --write ]; then
    step 'ruff check' ruff check --quiet --fix .
    step 'ruff format' ruff format --quiet .
    step stylua node tools/node/stylua.mjs --write $lua
else
    step 'ruff check' ruff check --quiet .
    step 'ruff format' ruff format --quiet --check .
    step basedpyright basedpyright
    step lint-imports lint-imports --no-cache --no-logo
    if [ -n "$lua" ]; then
        step luacheck luacheck --quiet $lua
        # Both dialects parse each file (one by one: luac5.4 crashes on several at once).
        for file in $lua; do
            step 'Lua 5.2' luac5.2 -p "$file"
            step 'Lua 5.4' luac5.4 -p "$file"
        done
    fi
    step stylua node tools/node/stylua.mjs --check $lua
fi

[ -z "$failed" ] || echo "lint: these found something:$failed" >&2
[ -z "$failed" ]
