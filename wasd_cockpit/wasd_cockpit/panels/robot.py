# SPDX-License-Identifier: Apache-2.0
"""The panels Robot and World: stop, states, choices, the speed of time; another robot or world."""

from mujoco.studio.dear_imgui import dear_imgui as imgui

from wasd_cockpit import style
from wasd_cockpit.link import Order, Setting, Snapshot
from wasd_cockpit.panels.page_panel import PageState
from wasd_cockpit.widgets import columns, in_rows

_ENTER = int(imgui.InputTextFlags.EnterReturnsTrue.value)
_HEIGHT = 24.0
STOP_LABEL = '\uf05e  E-STOP'
RELEASE_LABEL = 'release E-STOP'
# Icons of the font that Studio has.
_PAUSE, _RUN, _STEP, _RESET = '\uf04c', '\uf04b', '\uf051', '\uf0e2'


class Robot:
    """Gives the orders that are not motion."""

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        self._draw_stop(page, snapshot)
        if len(snapshot.robots) > 1:
            size = (columns(len(snapshot.robots)), _HEIGHT)
            for index, name in in_rows(enumerate(snapshot.robots)):
                if page.widgets.toggle(f'robot {name}', name, index == snapshot.robot, size):
                    page.link.order(Order('robot', name))
        if snapshot.choices:
            page.widgets.heading('STATE')
        across = 2 if page.layout.is_desk else 3
        size = (columns(across), _HEIGHT)
        for choice in in_rows(snapshot.choices, across):
            refusal = '' if choice.is_on else choice.refusal
            name = choice.name
            if page.widgets.toggle(name, name, choice.is_on, size, refusal=refusal):
                page.link.order(Order('key', choice.key))
        for setting in snapshot.settings:
            self._draw_setting(page, setting)
        self._draw_speed(page, snapshot)
        for fact in snapshot.facts:
            page.widgets.words(fact, style.DIM)

    def _draw_stop(self, page: PageState, snapshot: Snapshot) -> None:
        widgets, order = page.widgets, page.link.order
        width = imgui.GetContentRegionAvail().x
        if widgets.button('e-stop', STOP_LABEL, (width, 30.0), fill=style.ALARM, at_once=True):
            order(Order('e-stop'))
        if snapshot.stopped_by and widgets.button('end e-stop', RELEASE_LABEL, (width, _HEIGHT)):
            order(Order('end e-stop'))
        third = columns(3)
        is_paused = snapshot.is_paused
        label = f'{_RUN}  run' if is_paused else f'{_PAUSE}  pause'
        if widgets.button('pause', label, (third, _HEIGHT)):
            order(Order('pause', value=float(not is_paused)))
        imgui.SameLine()
        refusal = '' if is_paused else 'pause first'
        if widgets.button('step', f'{_STEP}  step', (third, _HEIGHT), refusal=refusal):
            order(Order('step'))
        imgui.SameLine()
        if widgets.button('reset', f'{_RESET}  reset', (third, _HEIGHT)):
            order(Order('reset'))

    def _draw_setting(self, page: PageState, setting: Setting) -> None:
        page.widgets.heading(setting.name.upper())
        size = (columns(min(len(setting.options), 3)), _HEIGHT)
        for option in in_rows(setting.options, 3):
            name, is_on = f'{setting.name} {option}', option == setting.chosen
            refusal = '' if is_on else setting.refusal
            if page.widgets.toggle(name, option, is_on, size, refusal=refusal):
                page.link.order(Order('choose', f'{setting.name}={option}'))

    def _draw_speed(self, page: PageState, snapshot: Snapshot) -> None:
        imgui.Spacing()
        width = columns(2)
        imgui.SetNextItemWidth(width)
        changed, speed = imgui.InputFloat('##speed', snapshot.speed, 0.1, 0.5, 'x %.2f', _ENTER)
        page.widgets.note_field('speed')
        if imgui.IsItemHovered():
            imgui.SetTooltip('speed of time; 0 is as fast as possible')
        # The button for slower time does not step to 0; 0 is typed.
        is_step = imgui.IsMouseDown(0) or imgui.IsMouseReleased(0)
        if changed and (speed > 0.0 or not is_step):
            page.link.order(Order('speed', value=speed))
        imgui.SameLine()
        wanted = snapshot.speed or max(snapshot.pace, 1e-9)
        share = min(max(snapshot.pace / wanted, 0.0), 1.0)
        size = imgui.Vec2(width, imgui.GetFrameHeight())
        imgui.ProgressBar(share, size, f'reached x {snapshot.pace:.2f}')


class World:
    """Chooses a robot and a world; only `restart` applies the choice."""

    def __init__(self) -> None:
        self._chosen: dict[str, str] = {}

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        start = snapshot.start
        now = {'robot': start.robot, 'world': start.world}
        for what, options in (('robot', start.robots), ('world', start.worlds)):
            page.widgets.heading(what.upper())
            size = (columns(3), _HEIGHT)
            for option in in_rows(options, 3):
                is_on = option == self._chosen.get(what, now[what])
                # Of a file its name, which tells most.
                label = option.rpartition('/')[2]
                if page.widgets.toggle(f'next {what} {option}', label, is_on, size):
                    self._chosen[what] = option
        chosen = {**now, **self._chosen}
        same = '' if chosen != now else 'this is the present run: choose another robot or world'
        imgui.Spacing()
        if page.widgets.button(
            'restart',
            'restart',
            (columns(1), 28.0),
            fill=style.COMMAND if chosen != now else None,
            refusal=start.refusal or same,
        ):
            page.link.order(Order('start', f'{chosen["robot"]} {chosen["world"]}'))
        page.widgets.words(start.words(chosen['robot'], chosen['world']), wrapped=True)
        why = start.refusal or 'This run ends; the page comes back by itself.'
        page.widgets.words(why, style.DIM, wrapped=True)
