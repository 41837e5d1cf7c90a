# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import pytest
from teleop_keyboard.keymap import canonical_key


@for_all(
    ('text', 'key'),
    [
        ('i', 'i'),
        ('+', '+'),
        ('SPACE', ' '),
        ('UP', 'UP'),
        ('F12', 'F12'),
        ('SHIFT+UP', 'SHIFT+UP'),
        ('SHIFT+CTRL+UP', 'CTRL+SHIFT+UP'),
        ('CTRL+a', 'CTRL+A'),
        ('ALT+x', 'ALT+x'),
        ('ALT+SPACE', 'ALT+SPACE'),
        ('CTRL++', 'CTRL++'),
    ],
)
def test_names_in_files_mean_the_keys_of_messages(text, key):
    assert canonical_key(text) == key


@for_all('text', ['', 'up', 'F13', 'CTRL+', 'ESCAPE', 'ii', '\x03', 'SHIFT+UPP'])
def test_an_unknown_name_is_an_error(text):
    with pytest.raises(ValueError, match='unknown key'):
        canonical_key(text)


def test_the_error_names_the_nearest_key():
    with pytest.raises(ValueError, match='did you mean SPACE'):
        canonical_key('SPCE')
