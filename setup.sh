#!/bin/sh
# Set the project up in ./.venv:  ./setup.sh        what it takes to run scenarios
#                                 ./setup.sh test   and what it takes to test and develop
# On Debian and its relatives the system packages are installed as well, where we may (root, or sudo without a
# password); elsewhere what is missing is named.
set -eu
cd "$(dirname "$0")"

# Python, and for the tests, which build FMUs and a host in C and mesh the heart, a compiler and the shared libraries that gmsh's
# and ecospy's wheels, and hosts without Python, leave to the system.
packages="python3 python3-venv"
# With a compiler the inner loops are compiled, and hearts beat several times as fast; without one NumPy computes them.
useful="gcc libc6-dev"
[ "${1:-}" = test ] && packages="$packages gcc libc6-dev libgl1 libglu1-mesa libgomp1 libpython3-dev libtbb12 libxcursor1 libxft2 libxinerama1 unzip"
# The tests open the report of a run in a browser; where there is none, they are skipped.
browser=""
[ "${1:-}" = test ] && ! command -v chromium >/dev/null && browser=chromium

missing=""
if command -v dpkg-query >/dev/null; then
    for package in $packages; do
        dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing="$missing $package"
    done
fi
# A Python that can make environments will do, wherever it came from.
if command -v python3 >/dev/null && python3 -c 'import ensurepip, venv' 2>/dev/null; then
    missing=$(echo "$missing" | sed 's/ python3-venv//; s/ python3//')
fi
if command -v cc >/dev/null; then
    useful=""
fi
if [ -n "$useful" ] && command -v dpkg-query >/dev/null && { [ "$(id -u)" = 0 ] || sudo -n true 2>/dev/null; }; then
    missing="$missing $useful"
elif [ -n "$useful" ]; then
    echo "setup: there is no C compiler, so that NumPy will compute everything, several times slower; with one (apt-get" \
        "install $useful), set up again" >&2
fi
as_root=""
if [ "$(id -u)" = 0 ]; then
    as_root=env
elif sudo -n true 2>/dev/null; then
    as_root=sudo
fi
if [ -n "$missing$browser" ] && [ -n "$as_root" ] && command -v apt-get >/dev/null; then
    $as_root apt-get update -qq || [ -z "$missing" ]
    [ -z "$missing" ] || $as_root apt-get install -y -qq --no-install-recommends $missing ca-certificates
    # Not all relatives of Debian have this package, and nothing but those tests needs it.
    [ -z "$browser" ] || $as_root apt-get install -y -qq --no-install-recommends $browser && browser=""
elif [ -n "$missing" ]; then
    echo "setup: please install first: apt-get install$missing" >&2
    exit 1
fi
if [ -n "$browser" ]; then
    echo "setup: there is no Chromium, so that the tests of report.html will be skipped; with it (apt-get install" \
        "$browser on Debian) they run" >&2
fi

python3 -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' || {
    echo "setup: Python 3.11, 3.12 or 3.13 is needed; python3 is $(python3 --version)" >&2
    exit 1
}
[ -x .venv/bin/python ] || python3 -m venv .venv
if [ "${1:-}" = test ]; then
    .venv/bin/python -m pip install --quiet --editable '.[test]'
else
    .venv/bin/python -m pip install --quiet --editable .
fi
