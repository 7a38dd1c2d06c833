// The list of keys, as a dialog.

import { button, h } from '../page/dom';

const KEYS: [string, string][] = [
  ['Drag, wheel, right drag', 'orbit, zoom, pan; by touch: one finger, pinch, two fingers'],
  ['Arrows, + −', 'orbit, zoom; in the first person: look around; on pages: pan, zoom'],
  ['W A S D, Q E', 'move, down, up'],
  ['V', 'switch between orbit and first person'],
  ['F, Shift+F', 'frame everything, frame the selection'],
  ['C', 'next scene camera'],
  ['1 … 9, 0', 'choose a view'],
  ['X', 'false colour'],
  ['[ ]', 'darker, brighter'],
  ['M', 'light meter'],
  ['Click, N, Shift+N', 'select, next, previous object'],
  ['Click a name', "go to that viewer's camera"],
  ['T, R, Y', 'move, rotate, scale the selection'],
  ['L', 'add a lamp'],
  ['Delete', 'remove the selection'],
  ['Ctrl+Z, Ctrl+Shift+Z', 'undo, redo'],
  ['Space', 'pause or resume the solve'],
  ['P, H', 'show or hide the panel; everything but the picture'],
  ['Escape', 'cancel the drag; clear the selection'],
  ['?', 'this list'],
];

export function makeHelp(): HTMLDialogElement {
  const dialog = h('dialog', { class: 'card help', 'aria-label': 'Keys' });
  dialog.append(
    // The button comes first, because it takes the focus and the dialog scrolls to it.
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
