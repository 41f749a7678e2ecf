#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The tracers and the renderer's laws on Debian's own lavapipe (Mesa 22.3: no ray tracing), unpacked into build/, not installed, so that they are
# proved there too where a newer Mesa is installed. Where the packages cannot be reached it says so and passes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
echo "== tracers and laws on the release's own lavapipe"
bash tests/support/each_tracer.sh tests/support/stock_mesa.sh "the release's archive"
