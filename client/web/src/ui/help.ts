// The list of keys.

import { button, h } from './dom';

const KEYS: [string, string][] = [
  ['Drag, wheel, right drag', 'turn, zoom, pan; on touch: one finger, pinch, two fingers'],
  ['Arrows, + −', 'turn, zoom'],
  ['W A S D, Q E', 'move, down, up'],
  ['V', 'orbit or first person'],
  ['F, Shift+F', 'frame everything, the selection'],
  ['C', "next of the scene's cameras"],
  ['1 … 9, 0', 'what is shown'],
  ['X', 'false colour'],
  ['[ ]', 'darker, brighter'],
  ['M', 'light meter'],
  ['Click, N, Shift+N', 'select, next, previous object'],
  ['Click a name', 'look from where that viewer looks'],
  ['T, R, Y', 'move, turn, scale the selection'],
  ['L', 'add a lamp'],
  ['Delete', 'remove the selection'],
  ['Ctrl+Z, Ctrl+Shift+Z', 'undo, redo'],
  ['Space', 'pause or resume the solve'],
  ['P, H', 'panel, hide everything but the picture'],
  ['Escape', 'let go of the selection'],
  ['?', 'this list'],
];

export function makeHelp(): HTMLDialogElement {
  const dialog = h('dialog', { class: 'card help', 'aria-label': 'Keys' });
  dialog.append(
    // The button comes first: it takes the focus, and what has the focus is scrolled to.
    h(
      'header',
      {},
      h('h2', {}, 'Keys'),
      button('Close', () => dialog.close()),
    ),
    h('dl', {}, ...KEYS.flatMap(([keys, what]) => [h('dt', {}, keys), h('dd', {}, what)])),
  );
  dialog.addEventListener('click', (event) => {
    if (event.target === dialog) dialog.close();
  });
  return dialog;
}
