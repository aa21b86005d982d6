#!/usr/bin/env bash
# Installs what tsdfpp needs on a Debian 12: packages, and MuJoCo and the page's libraries into .deps/. Idempotent; quick the second time.
# Usage: bash scripts/setup.sh [--fuzz]; --fuzz installs what scripts/fuzz.sh needs, too.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf 'setup: %s\n' "$*" >&2; }

as_root() {
  if [ "$(id -u)" = 0 ]; then
    "$@"
  elif command -v sudo >/dev/null; then
    sudo "$@"
  else
    say "packages are missing and neither root nor sudo is at hand; as root, run: $*"
    exit 3
  fi
}

if [ "$(. /etc/os-release && echo "$ID ${VERSION_ID:-}")" != "debian 12" ]; then
  say "this is not Debian 12; the package names and versions below may not fit"
fi

lists=(scripts/debian-packages.txt)
if [ "${1:-}" = "--fuzz" ]; then lists+=(scripts/debian-packages-fuzz.txt); fi
mapfile -t wanted < <(grep -hvE '^(#|$)' "${lists[@]}")
missing=()
for package in "${wanted[@]}"; do
  # Node.js from elsewhere brings its own npm and does not get along with Debian's.
  case "${package%%=*}" in nodejs) command -v node >/dev/null && continue ;; npm) command -v npm >/dev/null && continue ;; esac
  state=$(dpkg-query -W -f '${db:Status-Status}' "${package%%=*}" 2>/dev/null || true)
  [ "$state" = installed ] || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  say "installing ${#missing[@]} Debian packages: ${missing[*]%%=*}"
  as_root env DEBIAN_FRONTEND=noninteractive apt-get update -qq
  # libpcl-dev alone reaches VTK and Qt; without recommends it is still some 2 GB.
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi

mujoco_version=$(sed -n 's/^mujoco==\([0-9.]*\).*/\1/p' scripts/mujoco-requirements.txt)
if [ -n "${MUJOCO_ROOT:-}" ]; then
  say "MuJoCo: MUJOCO_ROOT is set, nothing is fetched"
elif [ ! -f ".deps/mujoco/lib/libmujoco.so.$mujoco_version" ]; then
  say "fetching MuJoCo $mujoco_version"
  scratch=$(mktemp -d)
  trap 'rm -rf "$scratch"' EXIT
  python3 -m pip download --quiet --disable-pip-version-check --no-deps --only-binary=:all: --require-hashes \
    --python-version 3.11 --implementation cp --platform "manylinux_2_28_$(uname -m)" \
    --platform "manylinux_2_27_$(uname -m)" --dest "$scratch" -r scripts/mujoco-requirements.txt
  python3 -m zipfile -e "$scratch"/mujoco-*.whl "$scratch/wheel"
  mkdir -p "$scratch/mujoco/lib"
  cp -r "$scratch/wheel/mujoco/include" "$scratch/mujoco/include"
  cp "$scratch/wheel/mujoco/libmujoco.so.$mujoco_version" "$scratch/mujoco/lib/"
  ln -s "libmujoco.so.$mujoco_version" "$scratch/mujoco/lib/libmujoco.so"
  cp "$scratch"/wheel/mujoco-*.dist-info/licenses/LICENSE "$scratch/mujoco/"
  rm -rf .deps/mujoco
  mkdir -p .deps
  mv "$scratch/mujoco" .deps/mujoco
fi

# What the page of `tsdfpp report` is bundled with, at the versions of the lock file.
if ! cmp -s viewer/package-lock.json .deps/viewer/package-lock.json; then
  say "fetching the libraries of the report's page"
  rm -rf .deps/viewer.part
  mkdir -p .deps/viewer.part
  cp viewer/package.json viewer/package-lock.json viewer/.npmrc .deps/viewer.part/
  (cd .deps/viewer.part && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error >/dev/null)
  rm -rf .deps/viewer
  mv .deps/viewer.part .deps/viewer
fi
