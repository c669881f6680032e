#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
#
# Puts the Wireshark programs of another Debian release beside this machine's own.
#
#   make_wireshark.sh SUITE FOLDER      SUITE: bookworm (4.0), trixie (4.4), sid (newest)
#
#   FOLDER/tshark, sharkd, editcap ..   started like any program, see this machine's paths
#   FOLDER/files/                       what the packages hold, unpacked, never configured
#   FOLDER/version                      first line of `tshark --version`
#
# Needs neither root nor a chroot: apt works out what tshark depends on against an empty status file and fetches it
# (signatures checked as always), dpkg-deb unpacks it, and each program starts through the release's own dynamic loader.
# The mirror is DALYSHARK_DEBIAN_MIRROR, or the one in this machine's apt sources.
#
# Lua: from 4.2 on Wireshark loads no script for root, and says nothing. So for root a program runs in a user namespace
# of its own where root is an ordinary user (its files stay its own there), or as nobody where that is forbidden.
set -eu
umask 022 # root's tests start these programs as nobody

die() {
    echo "make_wireshark: $*" >&2
    exit 2
}

[ $# -eq 2 ] || die "give a Debian release and a folder, such as: make_wireshark.sh trixie .cache/wireshark/trixie"
suite=$1
case $suite in '' | *[!a-z]*) die "$suite is no name of a Debian release" ;; esac
for tool in apt-get dpkg-deb; do
    command -v "$tool" >/dev/null || die "$tool is not here: other versions of Wireshark are taken from Debian packages"
done
keyring=/usr/share/keyrings/debian-archive-keyring.gpg
[ -r "$keyring" ] || die "Debian's keys are missing: type  sudo apt-get install debian-archive-keyring"

# The first of this machine's sources that is a Debian (not security, not another vendor's) mirror. Asks nobody.
mirror=${DALYSHARK_DEBIAN_MIRROR:-$(
    apt-get update --print-uris 2>/dev/null | sed -n "s#^'\(.*/debian\)/*dists/.*#\1#p" | head -n 1
)}
[ -n "$mirror" ] || die "no Debian mirror among the apt sources: set DALYSHARK_DEBIAN_MIRROR to the address of one"

mkdir -p "$2"
folder=$(cd "$2" && pwd)
rm -rf "$folder/files" "$folder/apt" "$folder/version"
mkdir -p "$folder/files" "$folder/apt/state/lists/partial" "$folder/apt/cache/archives/partial"
: >"$folder/apt/status"
echo "deb [signed-by=$keyring] $mirror $suite main" >"$folder/apt/sources.list"

# An apt that knows one source and no installed package. An unstable release's index may be older than it allows.
apt() {
    apt-get -qq -o Dir::State="$folder/apt/state" -o Dir::State::status="$folder/apt/status" \
        -o Dir::Cache="$folder/apt/cache" -o Dir::Etc::sourcelist="$folder/apt/sources.list" \
        -o Dir::Etc::sourceparts=/dev/null -o Dir::Etc::preferences=/dev/null -o Dir::Etc::preferencesparts=/dev/null \
        -o APT::Sandbox::User="$(id -un)" -o Acquire::Languages=none \
        -o Acquire::Check-Valid-Until=false -o Acquire::Retries=3 -o APT::Install-Recommends=false "$@" </dev/null
}
log=$folder/apt/log
{ apt update && apt install --yes --download-only tshark; } >"$log" 2>&1 ||
    die "$suite: $(sed -n 's/^E: //p' "$log" | head -n 1) (all of it: $log)"
for package in "$folder"/apt/cache/archives/*.deb; do
    dpkg-deb --extract "$package" "$folder/files"
done

# The loader lies beside the wrappers: Wireshark takes its folder for the program's own, and looks for dumpcap there.
loader=$(find "$folder/files" -name 'ld-linux*.so.*' -path '*-linux-gnu*' | head -n 1)
[ -n "$loader" ] || die "$suite: no dynamic loader among the packages"
libraries=${loader%/*}
triplet=${libraries##*/}
cp -L "$loader" "$folder/ld.so"

# The wrapper finds its folder when it runs, so FOLDER may be moved.
wrapper() {
    cat >"$folder/$1" <<EOF
#!/bin/sh
# Starts the $suite release's $1 through that release's dynamic loader. Made by make_wireshark.sh.
here=\$(cd "\$(dirname "\$(readlink -f "\$0")")" && pwd)
files=\$here/files
: "\${WIRESHARK_DATA_DIR:=\$files/usr/share/wireshark}"
: "\${WIRESHARK_PLUGIN_DIR:=\$files/usr/lib/$triplet/wireshark/plugins}"
export WIRESHARK_DATA_DIR WIRESHARK_PLUGIN_DIR
set -- "\$here/ld.so" --inhibit-cache --library-path "\$files/usr/lib/$triplet:\$files/lib/$triplet" "\$files/usr/bin/$1" "\$@"
if [ "\$(id -u)" = 0 ]; then
    if unshare --user --map-user=1000 --map-group=1000 true 2>/dev/null; then
        set -- unshare --user --map-user=1000 --map-group=1000 "\$@"
    else
        setpriv --reuid=65534 --regid=65534 --clear-groups test -r "\$HOME" 2>/dev/null || export HOME=/nonexistent
        set -- setpriv --reuid=65534 --regid=65534 --clear-groups "\$@"
    fi
fi
exec "\$@"
EOF
    chmod +x "$folder/$1"
}
for program in tshark sharkd dumpcap editcap capinfos mergecap text2pcap; do
    wrapper "$program"
done
rm -rf "$folder/apt"

first=$("$folder/tshark" --version 2>/dev/null | head -n 1) || first=
[ -n "$first" ] || die "$suite: its tshark does not start: $("$folder/tshark" --version 2>&1 | head -n 1)"
echo "$first" >"$folder/version"
