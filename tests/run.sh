#!/bin/sh
# Runs every test. Brings what the tests need: compilers and valgrind from the system's packages where this user may
# install them; VTK, meshio and pyvista from a Python that has them, else from PyPI into target/venv, else from Debian,
# which has no pyvista. Says exactly what is missing where it may not.
set -eu
cd "$(dirname "$0")/.."

# Registries have bad minutes: each is asked again, a minute apart, for so many seconds from the start.
PATIENCE=${PATIENCE:-180}
begin=$(date +%s)
patiently() { # seconds, command
    end=$((begin + $1))
    shift
    until "$@"; do
        [ "$(date +%s)" -lt "$end" ] || return 1
        echo "failed, trying again in a minute: $*" >&2
        sleep 60
    done
}

as_root=""
[ "$(id -u)" -eq 0 ] || as_root="sudo -n"
may_install() {
    command -v apt-get >/dev/null 2>&1 && $as_root true 2>/dev/null
}
install() { # Debian packages
    echo "installing: $*"
    $as_root apt-get update -qq && $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$@" >/dev/null
}

imports() { # Python, modules
    "$1" -c "import $2" 2>/dev/null
}
everything="meshio, vtk, pyvista, numpy"
venv=target/venv/bin/python
from_path() {
    imports python3 "$everything" && python=$(python3 -c 'import sys; print(sys.executable)')
}
from_venv() {
    imports $venv "$everything" && python=$PWD/$venv
}
from_pypi() {
    python3 -m venv target/venv || return 1
    if ! $venv -m pip install --disable-pip-version-check meshio==5.3.5 vtk pyvista numpy >target/pip.log 2>&1; then
        tail -n 6 target/pip.log >&2
        return 1
    fi
    from_venv
}
from_debian() {
    install --no-install-recommends python3-meshio python3-vtk9 python3-numpy || return 1
    imports /usr/bin/python3 "meshio, vtk, numpy" && python=/usr/bin/python3
}
find_python() {
    if from_path || from_venv; then return; fi
    if may_install; then
        patiently $((PATIENCE / 6)) from_pypi && return
        patiently "$PATIENCE" from_debian && export DIFFUSPH_WITHOUT=pyvista && return
    fi
    patiently "$PATIENCE" from_pypi
}
tell_what_is_left_out() {
    [ -z "${DIFFUSPH_WITHOUT:-}" ] || echo "LEFT OUT: the tests of files with $DIFFUSPH_WITHOUT" >&2
}

missing=""
need() { # command, Debian package
    command -v "$1" >/dev/null 2>&1 || missing="$missing $2"
}
need gcc gcc
need g++ g++
need gfortran gfortran
need make make
need cmake cmake
need valgrind valgrind
need pkg-config pkg-config
need python3 python3
[ -n "${DIFFUSPH_PYTHON:-}" ] || from_path || imports python3 ensurepip || missing="$missing python3-venv"

# shellcheck disable=SC2086 # a list of words
if [ -n "$missing" ] && ! { may_install && patiently "$PATIENCE" install $missing; }; then
    echo "missing:$missing. Install these packages with your system's package manager, then run this again." >&2
    exit 1
fi

if [ -z "${DIFFUSPH_PYTHON:-}" ]; then
    if ! find_python; then
        echo "missing: $everything could not be installed, neither into target/venv nor from Debian's packages." >&2
        echo "Set DIFFUSPH_PYTHON to a Python that has them, or run this again when PyPI answers." >&2
        exit 1
    fi
    export DIFFUSPH_PYTHON="$python"
fi
echo "VTK and meshio are those of $DIFFUSPH_PYTHON"
tell_what_is_left_out

export CARGO_NET_RETRY=10
patiently "$PATIENCE" cargo fetch --locked --target "$(rustc -vV | sed -n "s/^host: //p")"
cargo build --locked --all-features
cargo test --locked --all-features "$@"
tell_what_is_left_out
