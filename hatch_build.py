# SPDX-License-Identifier: Apache-2.0
"""What the one wheel takes from each package: its code, its shared files, its executables."""

import configparser
from pathlib import Path
import re
import tomllib
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

COMMAND = 'wasd'
INDEX = 'share/ament_index/resource_index/packages'
# Beside the manifest and the mark, where ROS tools look for them; and inside the import package.
SHARED = ('package.xml', 'config', 'foxglove', 'launch', 'rviz')
SHARED_INSIDE = ('urdf',)


class PackageFiles(BuildHookInterface[Any]):
    """Ships the packages that `dev-mode-dirs` lists; the venv becomes an ament prefix."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Say where each file comes from and where it goes."""
        for name in self.build_config.dev_mode_dirs:
            package = Path(self.root) / name
            if version != 'editable':
                modules = [path.parent.name for path in package.glob('*/__init__.py')]
                build_data['force_include'] |= {f'{name}/{m}': m for m in modules}
            shared = {path: path for path in SHARED}
            shared |= {f'{name}/{path}': path for path in SHARED_INSIDE}
            files = {
                f'{name}/{here}': f'share/{name}/{there}'
                for here, there in shared.items()
                if (package / here).exists()
            }
            build_data['shared_data'] |= files | {f'{name}/resource/{name}': f'{INDEX}/{name}'}


class Facts(MetadataHookInterface):
    """Gathers the executables, of each package's setup.cfg, and what a package index shows."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set scripts, addresses, and a README whose links lead somewhere from anywhere."""
        root = Path(self.root)
        settings = tomllib.loads((root / 'pyproject.toml').read_text())
        home = settings['tool']['wasd']['repository']
        metadata['urls'] = {
            'Repository': home,
            'Documentation': f'{home}/blob/main/docs/README.md',
            'Changelog': f'{home}/blob/main/CHANGELOG.md',
            'Issues': f'{home}/issues',
        }
        text = absolute((root / 'README.md').read_text(), home)
        metadata['readme'] = {'content-type': 'text/markdown', 'text': text}
        metadata['scripts'] = found = scripts(Path(self.root))
        # What `uvx wasd-robots` and `pipx run wasd-robots` start; not in ROS, where each
        # package's executables are its own.
        if COMMAND in found:
            found[metadata['name']] = found[COMMAND]


def absolute(text: str, home: str) -> str:
    """Return Markdown whose relative links and pictures have addresses in a repository."""
    text = re.sub(r'(!\[[^]]*\]\()(?!\w+:|#)', rf'\1{home}/raw/main/', text)
    return re.sub(r'(?<!!)(\[[^]]*\]\()(?!\w+:|#)', rf'\1{home}/blob/main/', text)


def scripts(root: Path) -> dict[str, str]:
    """Return the executables of all packages and where each begins."""
    parser = configparser.ConfigParser()
    lines: list[str] = []
    for path in sorted(root.glob('*/setup.cfg')):
        parser.clear()
        parser.read(path)
        lines += parser.get('options.entry_points', 'console_scripts', fallback='').split('\n')
    return dict(line.split(' = ', 1) for line in lines if line.strip())
