#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the documentation site into build/docs/site: Doxygen for the C headers, mkdocs-material for all else. Installs these from Debian where they
# are missing. The Python modules must be built, for their docstrings ($ACTIVESTEREO_BUILD, else build/). Usage: bash tests/docs.sh [FOLDER]
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/capi/packaging/build.sh"
install_packages "$root/tests/debian-packages-docs.txt"
cd "$root"
out=${1:-build/docs}
/usr/bin/python3 examples/guide/gather.py "$out"
echo "== Doxygen: the C headers"
(cat examples/guide/Doxyfile && echo "OUTPUT_DIRECTORY = \"$out\"") | doxygen -
echo "== mkdocs: the pages"
PYTHONPATH="${ACTIVESTEREO_BUILD:-$root/build}/python" /usr/bin/python3 -m mkdocs build --strict --config-file "$out/mkdocs.yml"
echo "== done: open $out/site/index.html"
