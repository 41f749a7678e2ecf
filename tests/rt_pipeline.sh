#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The tracers' agreement and the renderer's laws on a lavapipe with ray tracing pipelines (Mesa of bookworm-backports, unpacked into build/, not installed).
# Where that suite cannot be reached it says so and passes: the same tests skip by name in tests/run.sh.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
echo "== tracers and laws on a lavapipe with ray tracing pipelines"
bash tests/support/each_tracer.sh tests/support/rt_mesa.sh "bookworm-backports"
