# SPDX-License-Identifier: Apache-2.0
"""The executables that the packages name in setup.cfg; needs nothing but Python."""

import configparser
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def _scripts() -> dict[str, str]:
    found: dict[str, str] = {}
    for path in sorted(ROOT.glob('*/setup.cfg')):
        parser = configparser.ConfigParser()
        parser.read(path)
        lines = parser.get('options.entry_points', 'console_scripts', fallback='').splitlines()
        found |= dict(line.split(' = ', 1) for line in lines if line.strip())
    return found


# Name -> `module:function`.
SCRIPTS = _scripts()
