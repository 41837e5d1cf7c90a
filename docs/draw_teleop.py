# SPDX-License-Identifier: Apache-2.0
"""
Draws pictures/teleop.png: the dashboard of `teleop` as it looks while somebody drives mbot.

    python docs/draw_teleop.py [FILE]

`wasd mbot` runs without a window, `teleop` on a pseudo-terminal of 80 x 24. The keys w and a are
held for a moment; the last page that the terminal was sent is drawn. Needs DejaVu Sans Mono.
"""

from collections.abc import Iterator
import contextlib
import fcntl
import os
from pathlib import Path
import pty
import random
import re
import select
import struct
import subprocess
import sys
import termios
import time

from PIL import Image, ImageDraw, ImageFont
from teleop_keyboard.screen import BEGIN, END, NORMAL, STYLES

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / 'docs' / 'pictures' / 'teleop.png'
COLUMNS, LINES = 80, 24
FONT, FONT_SIZE = 'DejaVuSansMono.ttf', 18
MARGIN = 12  # [pixels]
PAPER, INK = '#1d2129', '#d8dee9'
COLOURS = {'title': INK, 'target': '#6fc3df', 'actual': '#8fd17b', 'warning': '#e5c07b'}
COLOURS['dim'] = '#69707d'
PATIENCE = 30.0


@contextlib.contextmanager
def running(*arguments: str, **options: object) -> Iterator[None]:
    """Run a module of Python until the context ends."""
    process = subprocess.Popen([sys.executable, '-m', *arguments], **options)
    try:
        yield
    finally:
        process.terminate()
        process.wait(PATIENCE)


class Terminal:
    """A pseudo-terminal and all that was written on it."""

    def __init__(self) -> None:
        self.master, self.slave = pty.openpty()
        size = struct.pack('HHHH', LINES, COLUMNS, 0, 0)
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, size)
        self._written = b''

    def read(self, seconds: float) -> str:
        """Read for so long; return the last complete page, '' before the first."""
        end = time.monotonic() + seconds
        while select.select([self.master], [], [], max(end - time.monotonic(), 0.0))[0]:
            self._written += os.read(self.master, 65536)
        pages = self._written.decode(errors='ignore').split(BEGIN)[1:]
        return next((page.partition(END)[0] for page in reversed(pages) if END in page), '')

    def wait_for(self, pattern: str, keys: bytes = b'') -> str:
        """Return the first page that matches; press keys again and again until then."""
        deadline = time.monotonic() + PATIENCE
        while re.search(pattern, page := self.read(1 / 30)) is None:
            if time.monotonic() > deadline:
                raise SystemExit(f'error: {pattern!r} did not show up; the last page:\n{page}')
            os.write(self.master, keys)
        return page


def capture() -> str:
    """Return a page of the dashboard while the robot speeds up around a bend."""
    os.environ['ROS_DOMAIN_ID'] = str(random.SystemRandom().randint(1, 100))
    os.environ.update(ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST', TERM='xterm-256color')
    terminal = Terminal()
    ends = {'stdin': terminal.slave, 'stdout': terminal.slave, 'start_new_session': True}
    nowhere = {'stdin': subprocess.DEVNULL, 'stdout': subprocess.DEVNULL}
    robot = 'wasd_bringup.cli', 'mbot', '--viewer', 'none', '--duration', '60'
    teleop = 'teleop_keyboard.teleop_node', '--ros-args', '-p', 'preset:=wasd'
    with running(*robot, **nowhere), running(*teleop, **ends):
        terminal.wait_for(r'\d subscriber')
        terminal.wait_for('actual')
        # Target and actual differ while the ramp is on its way.
        return terminal.wait_for(r'actual .*\+0\.[2-4]\d m/s', b'wa')


def draw(page: str) -> Image.Image:
    """Return the picture of a page; blocks are drawn, as fonts leave gaps between them."""
    font = ImageFont.truetype(FONT, FONT_SIZE)
    width = round(font.getlength('M'))
    height = round(1.28 * FONT_SIZE)
    size = (COLUMNS * width + 2 * MARGIN, LINES * height + 2 * MARGIN)
    picture = Image.new('RGB', size, PAPER)
    canvas = ImageDraw.Draw(picture)
    names = {code: name for name, code in STYLES.items()}
    for row, line in enumerate(page.replace('\r', '').replace('\x1b[K', '').split('\n')):
        style = next((name for code, name in names.items() if line.startswith(code)), '')
        text = re.sub(r'\x1b\[[0-9;]*m', '', line.removesuffix(NORMAL))
        colour, top = COLOURS.get(style, INK), MARGIN + row * height
        if style == 'title':
            canvas.rectangle((MARGIN, top, MARGIN + len(text) * width, top + height), fill=colour)
            colour = PAPER
        for column, character in enumerate(text):
            left = MARGIN + column * width
            if character == '█':
                canvas.rectangle((left, top + 2, left + width - 1, top + height - 3), fill=colour)
            elif character == '─':
                middle = top + height // 2
                canvas.line((left, middle, left + width, middle), fill=colour)
            else:
                canvas.text((left, top + 1), character, font=font, fill=colour)
    return picture.quantize(64)


def main() -> int:
    """Draw the picture; return the exit status."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE
    draw(capture()).save(target, optimize=True)
    print(f'wrote {target}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
