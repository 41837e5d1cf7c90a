# SPDX-License-Identifier: Apache-2.0
"""
`wasd` with a page that tells where its widgets are: `python page_watch.py FILE WORDS...`.

FILE has the rectangles of the last frame as JSON, name -> [left, top, right, bottom] in pixels.
"""

import json
from pathlib import Path
import sys

from wasd_bringup.cli import main
from wasd_cockpit.cockpit import Cockpit
from wasd_cockpit.widgets import Rect


def tell_rectangles(path: Path) -> None:
    """Have every cockpit of this process write to a file where its widgets are."""
    end, told = Cockpit.end, dict[str, Rect]()

    def end_and_tell(cockpit: Cockpit) -> None:
        end(cockpit)
        rects = cockpit.page.widgets.rects
        if rects != told:
            told.clear()
            told.update(rects)
            part = path.with_suffix('.part')
            part.write_text(json.dumps(rects))
            part.replace(path)

    Cockpit.end = end_and_tell  # type: ignore[method-assign]


if __name__ == '__main__':
    tell_rectangles(Path(sys.argv[1]))
    sys.exit(main(sys.argv[2:]))
