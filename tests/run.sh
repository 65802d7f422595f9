#!/bin/sh
# Runs every test. Brings what the tests need: compilers and valgrind from the system's packages where this user may
# install them, Python packages into target/venv. Says exactly what is missing where it may not.
set -eu
cd "$(dirname "$0")/.."

# Registries have bad minutes: tries again, a minute apart, for so many seconds from the start.
deadline=$(($(date +%s) + ${PATIENCE:-180}))
patiently() {
    until "$@"; do
        [ "$(date +%s)" -lt "$deadline" ] || return 1
        echo "failed, trying again in a minute: $*" >&2
        sleep 60
    done
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
python3 -c 'import ensurepip' 2>/dev/null || missing="$missing python3-venv"

if [ -n "$missing" ]; then
    as_root=""
    [ "$(id -u)" -eq 0 ] || as_root="sudo -n"
    echo "installing:$missing"
    install="$as_root apt-get update -qq && DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq $missing"
    if ! command -v apt-get >/dev/null 2>&1 || ! $as_root true || ! patiently sh -c "$install >/dev/null"; then
        echo "missing:$missing. Install these packages with your system's package manager, then run this again." >&2
        exit 1
    fi
fi

if [ -z "${DIFFUSPH_PYTHON:-}" ]; then
    python=target/venv/bin/python
    if ! "$python" -c 'import meshio, vtk, pyvista, numpy' 2>/dev/null; then
        python3 -m venv target/venv
        if ! patiently "$python" -m pip install --quiet meshio==5.3.5 vtk pyvista numpy; then
            echo "missing: meshio, vtk, pyvista and numpy could not be installed into target/venv." >&2
            echo "Set DIFFUSPH_PYTHON to a Python that has them, or run this again when PyPI answers." >&2
            exit 1
        fi
    fi
    DIFFUSPH_PYTHON="$PWD/$python"
    export DIFFUSPH_PYTHON
fi

export CARGO_NET_RETRY=10
patiently cargo fetch --locked --target "$(rustc -vV | sed -n "s/^host: //p")"
cargo build --locked --all-features
cargo test --locked --all-features "$@"
