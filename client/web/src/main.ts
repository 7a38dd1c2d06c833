// Starts the viewer, or tells the user why it cannot start.

import { App } from './app/app';
import { h } from './page/dom';

declare global {
  interface Window {
    /** For tests and for the console. */
    viewer?: App;
  }
}

try {
  if (!('WebGL2RenderingContext' in window)) throw new Error('This browser has no WebGL 2.');
  window.viewer = new App();
} catch (error) {
  console.error(error);
  document.body.append(
    h(
      'div',
      { class: 'fatal' },
      h('h1', {}, 'The viewer could not start'),
      h('p', {}, (error as Error).message),
      h(
        'p',
        {},
        'It needs WebGL 2. The progress of the solve is also on the ',
        h('a', { href: '/status' }, 'status page'),
        '.',
      ),
    ),
  );
}
