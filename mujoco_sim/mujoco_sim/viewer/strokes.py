# SPDX-License-Identifier: Apache-2.0
"""What a field of text is shown of a keyboard, whose strokes may come faster than frames."""

from typing import NamedTuple

# So many strokes wait for frames of panels at most; what is typed beyond is for no field.
MOST_STROKES = 64
# A text that waits grows no longer [characters]: a packet has room for 256, some of which are two.
MOST_TYPED = 100


class Stroke(NamedTuple):
    """The keys that are down, by ImGui's numbers, and the text that was typed meanwhile."""

    keys: frozenset[int] = frozenset()
    text: str = ''


class Strokes:
    """
    Shows the panels one stroke at a time.

    NetImgui hands each frame of panels the latest keys alone, and the text after them: what is
    typed and then entered within a frame would be entered without its last character. So a stroke
    is shown until a frame has seen it; later ones wait. This class reads no clock.
    """

    def __init__(self, mark: frozenset[int], acts: frozenset[int]) -> None:
        """
        Take two kinds of keys by ImGui's numbers.

        `mark` goes down or up with each stroke: by it a frame tells which it has seen. `acts` do
        something to a field.
        """
        self._mark, self._acts = mark, acts
        self._is_marked = self._seen = False
        self._shown = self._before = self._told = frozenset[int]()
        self._waiting: list[Stroke] = []
        self._left = frozenset[int]()  # down for the panels when a page was lost
        self.is_changing_page = False

    @property
    def is_seen(self) -> bool:
        """Whether none waits, and a frame of panels has seen the last."""
        return not self._waiting and self._seen == self._is_marked

    @property
    def unseen(self) -> frozenset[int]:
        """The keys that went down in strokes that no frame has seen."""
        seen = self._shown if self._seen == self._is_marked else self._before
        return self._shown.union(*(stroke.keys for stroke in self._waiting)) - seen

    def see(self, is_marked: bool) -> None:
        """Take whether a frame of panels has seen the mark down."""
        self._seen = is_marked

    def forget(self) -> None:
        """Let nothing wait: another browser types."""
        self._left |= self._shown
        self._waiting.clear()
        self._shown = self._before = self._told = frozenset()

    def change_page(self) -> None:
        """Show what the panels still see down of a page that is gone, then that it is up."""
        self.is_changing_page = bool(self._left)
        self._waiting = [Stroke(self._left), Stroke()] if self._left else []
        self._left = frozenset()

    def skip(self, told: Stroke) -> Stroke:
        """Take a stroke that is for no field: it is seen at once."""
        self._waiting.clear()
        self._shown = self._before = self._told = told.keys
        return self._marked(told)

    def show(self, told: Stroke) -> Stroke:
        """
        Take a stroke; return what is to be seen now.

        A text that comes with a press of one of `acts` was typed before it.
        """
        has_room = len(self._waiting) < MOST_STROKES
        new, last = told.keys - self._told, self._waiting[-1] if self._waiting else Stroke()
        if last.text and len(last.text + told.text) <= MOST_TYPED and not new & self._acts:
            # More text, or the end of a press, is seen in the same frame.
            if told.text or not new:
                self._waiting[-1] = Stroke(told.keys, last.text + told.text)
                self._told, told = told.keys, Stroke(told.keys)
        elif has_room and told.text and new & self._acts:
            self._waiting.append(Stroke(self._told, told.text))
            told = Stroke(told.keys)
        if has_room and (told.text or told.keys != self._told):
            self._waiting.append(told)
            self._told = told.keys
        if not self._waiting or self._seen != self._is_marked:
            return self._marked(Stroke(self._shown))
        stroke = self._waiting.pop(0)
        self._is_marked = not self._is_marked
        self._before, self._shown = self._shown, stroke.keys
        self.is_changing_page &= bool(self._waiting)
        return self._marked(stroke)

    def _marked(self, stroke: Stroke) -> Stroke:
        return stroke._replace(keys=stroke.keys | self._mark) if self._is_marked else stroke
