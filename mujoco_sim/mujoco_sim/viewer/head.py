# SPDX-License-Identifier: Apache-2.0
"""What is ours in the head of Studio's page: keys and pointers set right, and an E-STOP."""

# A phone's pixels are as large as it says: else all is half as large, also when it was turned: it
# would shrink the page to show the whole width of before, and the page would keep that width.
#
# What leaves the page forgets its keys: the repeat of one that is still down is no press.
#
# Studio has one pointer for the mouse and all fingers. Only the last that came down moves it, for
# that one may mean the E-STOP: Studio is told that the one before was let go, and nothing more of
# it. While several are down, and until none is, the key F24 is down: see SEVERAL of input.py.
HEAD = b"""<head><meta name="viewport"
  content="width=device-width, initial-scale=1, minimum-scale=1"><script>{
  const down = new Set();
  const forget = () => down.clear();
  for (const leaving of ['blur', 'visibilitychange']) addEventListener(leaving, forget, true);
  addEventListener('keyup', event => down.delete(event.code), true);
  addEventListener('keydown', event => {
    if (!event.repeat) down.add(event.code);
    else if (!down.has(event.code)) event.stopImmediatePropagation();
  }, true);

  let finger = null;          // the one that Studio follows
  const pressed = new Map();  // the mouse's buttons that Studio knows to be down
  let fingers = 0, buttons = 0, areSeveral = false;
  const isOurs = event => event.isTrusted && event.target instanceof HTMLCanvasElement;
  const setSeveral = isDown => {
    if (isDown !== areSeveral) dispatchEvent(new KeyboardEvent(
      isDown ? 'keydown' : 'keyup', {code: 'F24', key: 'F24', keyCode: 135}));
    areSeveral = isDown;
  };
  // No TouchEvent: not every browser makes one of an array.
  const tell = (what, touch) => touch.target.dispatchEvent(Object.assign(
    new UIEvent(what, {bubbles: true, cancelable: true}),
    {touches: [], targetTouches: [], changedTouches: [touch]}));
  const letGo = () => {
    if (finger) tell('touchend', finger);
    for (const press of pressed.values()) press.target.dispatchEvent(
      new MouseEvent('mouseup', press));
    finger = null;
    pressed.clear();
  };
  const settle = () => { if (!fingers && !buttons) setSeveral(false); };

  const hearTouch = event => {
    if (!isOurs(event)) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    fingers = event.touches.length;
    for (const touch of event.changedTouches) {
      if (event.type === 'touchstart') {
        if (fingers > 1 || buttons) setSeveral(true);
        letGo();
        finger = touch;
      }
      if (touch.identifier !== finger?.identifier) continue;
      tell(event.type, touch);
      finger = event.type === 'touchend' || event.type === 'touchcancel' ? null : touch;
    }
    settle();
  };
  for (const what of ['touchstart', 'touchmove', 'touchend', 'touchcancel'])
    addEventListener(what, hearTouch, {capture: true, passive: false});

  addEventListener('mousedown', event => {
    if (!isOurs(event)) return;
    buttons = event.buttons;
    if (fingers) setSeveral(true);
    if (finger) letGo();
    // A finger may have been elsewhere since the mouse moved.
    event.target.dispatchEvent(new MouseEvent('mousemove', event));
    pressed.set(event.button, event);
  }, true);
  const hearMouse = event => {
    if (!event.isTrusted) return;
    buttons = event.buttons;
    if (finger) event.stopImmediatePropagation();
    else if (event.type === 'mouseup') pressed.delete(event.button);
    settle();
  };
  for (const what of ['mousemove', 'mouseup']) addEventListener(what, hearMouse, true);
}</script>"""

# A page without control has no panels: this is its E-STOP, where the panels have theirs. It says
# what became of a press, by the server's answer or the lack of one.
E_STOP = b"""<script>addEventListener('DOMContentLoaded', () => {
  const button = document.createElement('button');
  button.style = 'position:fixed; left:20px; top:40px; width:124px; height:48px; padding:0;'
    + 'border:0; border-radius:4px; background:#d63d3d; color:#fff; font:bold 16px sans-serif;'
    + 'touch-action:manipulation; user-select:none';
  let socket, timer;
  const say = (words, seconds, next) => {
    button.textContent = words;
    clearTimeout(timer);
    timer = setTimeout(next, 1000 * seconds);
  };
  const rest = () => { button.textContent = 'E-STOP'; };
  const fail = () => say('NO ANSWER', 5, rest);
  button.addEventListener('pointerdown', () => {
    say('...', 3, fail);
    if (socket) socket.onclose = null;
    socket = new WebSocket(`ws://${location.host}/e_stop`);
    socket.onclose = fail;
    socket.onmessage = event => {
      event.target.onclose = null;
      say(event.data, 2, rest);
    };
  });
  rest();
  document.body.append(button);
  setInterval(() => { button.hidden = window.Module?.isSpectator === false; }, 100);
});</script>"""
