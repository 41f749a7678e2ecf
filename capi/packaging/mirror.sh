# SPDX-License-Identifier: Apache-2.0
# Packages and sources from the mirror that the machine itself is set up with, through lists and state of one's own: nothing is installed, and the
# machine's lists stay as they are. Sourced by embree_archives.sh and tests/support/unpacked_mesa.sh.
debian_key=/usr/share/keyrings/debian-archive-keyring.gpg
release=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")

# The URI of the mirror of this release; nothing where apt knows none.
mirror_uri() {
  # shellcheck disable=SC2016  # apt's own placeholders
  apt-get indextargets --format '$(REPO_URI) $(CODENAME) $(COMPONENT)' 'Created-By: Packages' |
    awk -v release="$release" '$2 == release && $3 == "main" { print $1; exit }'
}

# apt_in FOLDER TOOL...: apt-get or apt-cache with what FOLDER/apt/sources.list names.
apt_in() {
  local folder=$1 tool=$2
  shift 2
  "$tool" -o Dir::Etc::sourcelist="$folder/apt/sources.list" -o Dir::Etc::sourceparts=/dev/null -o Dir::State::lists="$folder/apt/lists" \
    -o Dir::Cache="$folder/apt" -o Debug::NoLocking=1 -o APT::Sandbox::User="$(id -un)" "$@"
}
