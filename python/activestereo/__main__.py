import sys

from activestereo.cli import main

sys.exit(main())
