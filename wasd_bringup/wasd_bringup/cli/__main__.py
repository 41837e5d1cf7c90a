# SPDX-License-Identifier: Apache-2.0
"""`python -m wasd_bringup.cli` is the command `wasd`."""

import sys

from wasd_bringup.cli.main import main

sys.exit(main())
