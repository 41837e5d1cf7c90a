# SPDX-License-Identifier: Apache-2.0
"""The executables that the packages name in setup.cfg, as the wheel's build gathers them."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_spec = importlib.util.spec_from_file_location('hatch_build', ROOT / 'hatch_build.py')
_build = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_build)
# Name -> `module:function`.
SCRIPTS = _build.scripts(ROOT)
