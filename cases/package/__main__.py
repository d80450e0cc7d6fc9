"""``python -m tetlux`` is ``tetlux``."""

import sys

from tetlux.cases.cli import main

sys.exit(main())
