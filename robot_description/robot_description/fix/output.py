# SPDX-License-Identifier: Apache-2.0
"""Writes what was mended, never over a source."""

from pathlib import Path
import shutil

from wasd_core.errors import DescriptionError
from wasd_core.output_file import identity
from wasd_core.output_file import OutputFile

from robot_description.fix.run import Fixes
from robot_description.package_tree import own_folder


def write_mended(fixes: Fixes, description: Path, output: Path) -> Path:
    """
    Write the mended description and return where it is.

    A file gets the description, when nothing else changed; a folder gets a copy of its package.

    Raises:
        DescriptionError: that would write over something, or cannot be written.
    """
    if identity(output) in {identity(file) for file in fixes.before}:
        raise DescriptionError(f'--output {output}: is a source; it is not written over')
    others = [file for file in fixes.after if file != description]
    try:
        if output.is_dir():
            return _copy_package(fixes, description, output)
        if others:
            raise DescriptionError(
                f'--output {output}: {others[0]} changes, too: name a folder that exists, which '
                'gets a copy of the package'
            )
        text = fixes.after.get(description, fixes.before[description])
        OutputFile(output, '--output').write(text)
        return output
    except OSError as error:
        raise DescriptionError(f'--output {output}: {error.strerror or error}') from None


def _copy_package(fixes: Fixes, description: Path, output: Path) -> Path:
    folder = own_folder(description)
    target = output / folder.name
    if target.exists():
        raise DescriptionError(f'--output {output}: {target} is there already')
    if output.resolve().is_relative_to(folder.resolve()):
        raise DescriptionError(f'--output {output}: lies within the package {folder}')
    shutil.copytree(folder, target, symlinks=True)
    for file, text in fixes.after.items():
        copy = target / file.resolve().relative_to(folder.resolve())
        copy.unlink()  # which may be a link
        copy.write_bytes(text)
    return target / description.resolve().relative_to(folder.resolve())
