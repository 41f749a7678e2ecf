# SPDX-License-Identifier: Apache-2.0
import sys

from activestereo.cli import main

sys.exit(main())
