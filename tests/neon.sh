#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The CPU matcher and signal stages for 64-bit ARM: cross-built with Debian's compiler, run under qemu's user emulation, compared bit for bit with the
# scalar reference. Highway's library for arm64 is unpacked into build/neon by apt with a private list and state: neither the machine's package sources
# nor its architectures are touched. Tests to run may be named: bash tests/neon.sh --gtest_filter='matcher.*'
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
home=$root/build/neon
. "$root/capi/packaging/build.sh"

private_apt() {
  apt-get -o Dir::Etc::sourcelist="$home/apt/sources.list" -o Dir::Etc::sourceparts=/dev/null -o Dir::State::lists="$home/apt/lists" \
    -o Dir::State::status=/dev/null -o Dir::Cache="$home/apt" -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o Debug::NoLocking=1 \
    -o APT::Sandbox::User="$(id -un)" "$@"
}

bring_highway() {
  local release uri key=/usr/share/keyrings/debian-archive-keyring.gpg
  release=$(. /etc/os-release && echo "$VERSION_CODENAME")
  # shellcheck disable=SC2016  # apt's own placeholders
  uri=$(apt-get indextargets --format '$(REPO_URI) $(CODENAME) $(COMPONENT)' 'Created-By: Packages' |
    awk -v release="$release" '$2 == release && $3 == "main" { print $1; exit }')
  rm -rf "$home/apt" "$home/root"
  mkdir -p "$home/apt/lists/partial"
  echo "deb [arch=arm64 signed-by=$key] $uri $release main" >"$home/apt/sources.list"
  echo "== neon: Highway's library for arm64 from the machine's own mirror"
  private_apt update -qq -o APT::Update::Error-Mode=any
  (cd "$home/apt" && private_apt download -qq libhwy1)
  dpkg -x "$home"/apt/libhwy1_*_arm64.deb "$home/root"
  rm -rf "$home/apt"
}

install_packages "$root/tests/debian-packages-neon.txt"
library=$home/root/usr/lib/aarch64-linux-gnu/libhwy.so.1
[ -e "$library" ] || bring_highway
cmake -S "$root/tests/neon" -B "$home" -G Ninja -DCMAKE_BUILD_TYPE=Release -DHIGHWAY_LIBRARY="$library" >/dev/null
cmake --build "$home" --target neon_tests
echo "== neon: bit for bit beside the scalar reference, under $(qemu-aarch64 --version | head -n 1)"
qemu-aarch64 -cpu cortex-a72 -L /usr/aarch64-linux-gnu -E LD_LIBRARY_PATH="${library%/*}" "$home/neon_tests" --gtest_brief=1 "$@"
