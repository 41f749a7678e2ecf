#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Brings the release's own lavapipe (Debian 12: Mesa 22.3, no ray tracing) into build/stock-mesa, without installing anything
# (unpacked_mesa.sh), for machines where a newer one is installed. Run again it does only the last step:
#   bash tests/support/stock_mesa.sh              prints the environment to use (VK_DRIVER_FILES and LD_LIBRARY_PATH)
#   bash tests/support/stock_mesa.sh COMMAND...   runs the command in that environment
# Exit status 3: the release's packages cannot be reached.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
home=$root/build/stock-mesa
suite=
name=stock_mesa
lost="what runs on the release's own Mesa is not tested; everything else runs on the installed one"
# shellcheck source=tests/support/unpacked_mesa.sh
. "$root/tests/support/unpacked_mesa.sh"
run_in_mesa "$@"
