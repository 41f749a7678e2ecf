#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Brings a lavapipe that has VK_KHR_ray_tracing_pipeline (Debian's backports of Mesa) into build/rt-mesa, without installing anything
# (unpacked_mesa.sh). Run again it does only the last step:
#   bash tests/support/rt_mesa.sh              prints the environment to use (VK_DRIVER_FILES and LD_LIBRARY_PATH)
#   bash tests/support/rt_mesa.sh COMMAND...   runs the command in that environment
# Exit status 3: backports cannot be reached.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
home=$root/build/rt-mesa
suite=-backports
name=rt_mesa
lost="the tests that need ray tracing pipelines will be skipped; everything else runs on the installed Mesa"
# shellcheck source=tests/support/unpacked_mesa.sh
. "$root/tests/support/unpacked_mesa.sh"
run_in_mesa "$@"
