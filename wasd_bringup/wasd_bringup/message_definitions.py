# SPDX-License-Identifier: Apache-2.0
"""The whole text that defines a message type, as recordings carry it."""

from functools import cache
import re

from robot_description.packages import share_directory

from wasd_bringup.errors import UsageError

SEPARATOR = '=' * 80
# The type at the beginning of a field's line: package and name, or a name of the same package.
_NESTED = re.compile(r'^\s*(?:(?P<package>\w+)/(?:msg/)?)?(?P<name>[A-Z]\w*)\b', re.MULTILINE)


@cache
def full_definition(kind: str) -> str:
    """
    Return the .msg text of a type `package/msg/Name`, then those of all types in it (`ros2msg`).

    Raises:
        UsageError: a definition is not where its package is installed.
    """
    package, _, name = kind.split('/')
    first = (package, name)
    texts = {first: _text(*first)}
    waiting = [first]
    while waiting:
        inside = waiting.pop(0)
        for match in _NESTED.finditer(texts[inside]):
            nested = (match['package'] or inside[0], match['name'])
            if nested not in texts:
                texts[nested] = _text(*nested)
                waiting.append(nested)
    parts = [texts.pop(first)]
    parts += [f'MSG: {"/".join(nested)}\n{text}' for nested, text in texts.items()]
    return f'\n{SEPARATOR}\n'.join(parts)


def _text(package: str, name: str) -> str:
    path = share_directory(package) / 'msg' / f'{name}.msg'
    try:
        return path.read_text(encoding='utf-8')
    except OSError as error:
        raise UsageError(f'{path}: {error.strerror}; a recording needs it') from None
