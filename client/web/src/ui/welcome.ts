// What the page says instead of a picture: that there is no scene and how to send one, or that a scene is loading.

import { h } from '../page/dom';

export class Welcome {
  readonly element = h('div', { class: 'welcome card', hidden: true });
  /** There is a picture, which the welcome must not cover. */
  sceneShown = false;
  private readonly loadBar = h('progress', { max: 1, value: 0, 'aria-label': 'How much of the scene is loaded' });

  show(state: string, failure = '', fraction = 0): void {
    const { element } = this;
    this.loadBar.value = fraction;
    element.hidden = !['empty', 'failed'].includes(state) && (state !== 'loading' || this.sceneShown);
    const shown = `${state} ${failure}`;
    if (element.hidden || element.dataset['state'] === shown) return;
    element.dataset['state'] = shown;
    if (state === 'loading')
      return element.replaceChildren(
        h('h2', {}, 'Loading the scene'),
        this.loadBar,
        h('p', {}, 'Laying out its surfaces for lightmaps; a large scene takes a while.'),
      );
    element.replaceChildren(
      h('h2', {}, state === 'failed' ? 'The server has lost the scene' : 'No scene yet'),
      failure && h('p', {}, `Reason: ${failure}.`),
      h('p', {}, 'Drop a .glb here, or send one:'),
      h('pre', { class: 'code' }, `curl -T room.glb ${location.origin}/scene`),
    );
  }
}
