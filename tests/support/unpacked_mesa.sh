#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Brings a Mesa lavapipe into a folder without installing anything: packages come by apt from the machine's own mirror through a private list and
# state, and are unpacked there. Sourced by rt_mesa.sh and stock_mesa.sh, which set
#   home    the folder                     suite   "" for the release's own packages, "-backports" for its backports
#   name    for messages                   lost    what to say when it cannot be had
# and call run_in_mesa "$@". What it does goes to stderr. Exit status 3: the suite cannot be reached.

icd=$home/lvp_icd.json
. "$(dirname "${BASH_SOURCE[0]}")/../../capi/packaging/mirror.sh"

say() { echo "$name: $*" >&2; }

give_up() {
  say "$*"
  say "$lost"
  exit 3
}

private_apt() { apt_in "$home" "$1" -o APT::Default-Release="$release$suite" "${@:2}"; }

# Package names on stdin; "name installed candidate" of each on stdout.
versions_of() {
  local packages
  mapfile -t packages
  private_apt apt-cache policy "${packages[@]}" |
    awk '/^[a-z0-9]/ { name = $1; sub(/:$/, "", name) } /^  Installed:/ { installed = $2 } /^  Candidate:/ { print name, installed, $2 }'
}

# Mesa's driver and what it depends on: a dependency is brought when it is not installed, or when backports are asked for and have a newer one.
packages_to_bring() {
  local package installed candidate
  private_apt apt-cache depends --recurse --no-recommends --no-suggests --no-conflicts --no-breaks --no-replaces --no-enhances \
    mesa-vulkan-drivers | grep '^[a-z0-9]' | sort -u | versions_of |
    while read -r package installed candidate; do
      if [ "$package" = mesa-vulkan-drivers ]; then
        echo "$package/$release$suite"
      elif [ "$candidate" = '(none)' ]; then
        continue
      elif [ "$installed" = '(none)' ]; then
        echo "$package"
      elif [[ $suite == -backports && $candidate == *~bpo* ]] && dpkg --compare-versions "$installed" lt "$candidate"; then
        echo "$package"
      fi
    done
}

bring() {
  local uri packages deb
  uri=$(mirror_uri)
  [ -n "$uri" ] || give_up "apt knows no mirror of Debian '$release'"
  rm -rf "$home"
  mkdir -p "$home/apt/lists/partial" "$home/debs" "$home/root"
  printf "deb [signed-by=$debian_key] $uri %s main\n" "$release" ${suite:+"$release$suite"} >"$home/apt/sources.list"
  say "reading the package lists of $release${suite:+ and $release$suite} from the machine's own mirror (private state, $home/apt)"
  private_apt apt-get update -qq -o APT::Update::Error-Mode=any >&2 || give_up "$release$suite cannot be reached through the machine's mirror"
  mapfile -t packages < <(packages_to_bring)
  [ ${#packages[@]} -gt 0 ] || give_up "$release$suite has no mesa-vulkan-drivers"
  say "downloading ${packages[*]}"
  (cd "$home/debs" && private_apt apt-get download -qq "${packages[@]}" >&2) || give_up "downloading from $release$suite failed"
  for deb in "$home"/debs/*.deb; do dpkg -x "$deb" "$home/root"; done
  rm -rf "$home/debs" "$home/apt"
}

write_icd() {
  local library
  library=$(find "$home/root" -name libvulkan_lvp.so | head -n 1)
  [ -n "$library" ] || give_up "the package mesa-vulkan-drivers holds no libvulkan_lvp.so"
  # Written last: its presence says that the rest is complete.
  printf '{"file_format_version": "1.0.0", "ICD": {"library_path": "%s", "api_version": "1.3.0"}}\n' "$library" >"$icd.part"
  mv "$icd.part" "$icd"
  say "it is in $home"
}

# Runs the command with the unpacked driver; without one, prints the environment to use.
run_in_mesa() {
  local libraries environment
  if [ ! -f "$icd" ]; then
    bring
    write_icd
  fi
  libraries=$(dirname "$(find "$home/root" -name libvulkan_lvp.so | head -n 1)")
  environment=("VK_DRIVER_FILES=$icd" "LD_LIBRARY_PATH=$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}")
  if [ $# -eq 0 ]; then
    echo "${environment[@]}"
  else
    exec env "${environment[@]}" "$@"
  fi
}
