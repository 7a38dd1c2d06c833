// The panel "Scene": a list of objects, and an editor of the selected one.

import { MathUtils, Euler, Quaternion } from 'three';
import { isVisible } from '../document/edits';
import { hangingNodes, materialName, nodeName, type Gltf, type Vec3, type Vec4 } from '../document/gltf';
import { handlesOf, lightOf, lookOf, type Handle, type LampWebs, type NodeLight } from '../document/lights';
import type { Placement } from '../document/edits';
import { fromHex, toHex } from '../page/colours';
import { button, buttons, panel, checkbox, field, h, row, section } from '../page/dom';
import { parseNumber } from '../page/numbers';
import type { SkyTurn } from '../document/skies';
import { emissionFields, emissionWritten } from './emission_fields';
import { addLampButtons, lightEditor, type LampActions } from './lamp_section';
import { SkyFields } from './sky_fields';

export interface Selection {
  node: number;
  material: number | undefined;
}

export interface ScenePanelActions extends LampActions {
  select(selection: Selection | undefined): void;
  setColour(material: number, rgb: Vec3): void;
  setEmission(material: number, rgb: Vec3, strength: number): void;
  setPlacement(node: number, placement: Placement): void;
  setVisible(node: number, visible: boolean): void;
  remove(node: number): void;
  frameSelection(): void;
  endGesture(): void;
  loadFile(file: File): void;
  setSky(member: keyof SkyTurn, value: number): void;
  openSky(file: File): void;
  /** `wanted`: the values that the field accepts. */
  notAccepted(text: string, wanted: string): void;
}

const MOST_LISTED = 400;
/** So many objects need no search field. */
const FEW = 12;
const MOST_LETTERS = 200;

/** A number for a narrow field: four digits; hundredths of large numbers; 0 where rounding has left less than that. */
export function briefly(value: number): string {
  const size = Math.abs(value);
  if (size < 1e-9) return '0';
  if (size < 1e-3) return value.toExponential(1);
  return String(Number(size < 100 ? value.toFixed(Math.min(4, 3 - Math.floor(Math.log10(size)))) : value.toFixed(2)));
}

/** The values that a field accepts, and their name in the message about others. */
const ANY_NUMBER = { wanted: 'a number', isGood: (value: number) => Number.isFinite(value) };

interface ListEntry {
  node: number;
  depth: number;
  name: string;
  visible: boolean;
  light: boolean;
}

export class ScenePanel {
  readonly element: HTMLElement;
  private readonly list = h('ul', { class: 'tree', 'aria-label': 'Objects' });
  private readonly find = h('input', { type: 'search', 'aria-label': 'Find an object by name' });
  private readonly findRow = field('Find', this.find);
  private readonly entries = new Map<number, HTMLElement>();
  private listText = '';
  private readonly editor = h('div', { class: 'editor' });
  private gltf: Gltf = { asset: { version: '2.0' } };
  private selection: Selection | undefined;
  private webs: LampWebs = new Map();
  private revealed: number | undefined;
  private edited: number | undefined;
  /** The user is writing a value that was not sent yet. */
  private typing = false;
  /** The document has changed while the user was writing. */
  private stale = false;
  private materialsOf: (node: number) => number[] = () => [];
  private readonly sky: SkyFields;

  constructor(private readonly actions: ScenePanelActions) {
    this.sky = new SkyFields(actions);
    const file = h('input', { type: 'file', accept: '.glb,.gltf', class: 'offscreen', tabIndex: -1 });
    file.onchange = () => {
      const chosen = file.files?.[0];
      if (chosen) actions.loadFile(chosen);
      file.value = '';
    };
    this.element = panel(
      section(
        'Objects',
        this.findRow,
        this.list,
        addLampButtons(actions),
        buttons(
          button('Open scene…', () => file.click(), { title: 'Or drop a .glb on the page' }),
          file,
        ),
      ),
      this.sky.element,
      this.editor,
    );
    this.find.addEventListener('input', () => this.showList());
    // Captured before the field hears of the event, as the value that the field sends would reset all fields.
    this.editor.addEventListener('input', () => (this.typing = true), true);
    // The user chooses a colour from the click that opens its picker until the picker closes.
    this.editor.addEventListener('click', ({ target }) => {
      if ((target as HTMLInputElement).type === 'color') this.typing = true;
    });
    this.editor.addEventListener('change', () => {
      this.typing = false;
      // A value that was just sent may change others, such as a lamp's flux with its size.
      if (this.stale) this.showEditor();
    });
    // The list cannot scroll to the selection while another tab is open.
    new ResizeObserver(() => this.revealSelection()).observe(this.list);
  }

  setDocument(gltf: Gltf, materialsOf: (node: number) => number[]): void {
    this.gltf = gltf;
    this.materialsOf = materialsOf;
    this.refresh();
  }

  setSelection(selection: Selection | undefined): void {
    this.selection = selection;
    this.refresh();
  }

  /** Photometric webs that are known: with its own a lamp's flux is. */
  setWebs(webs: LampWebs): void {
    this.webs = webs;
    this.refresh();
  }

  /**
   * Shows the document as it is after everyone's edits and after refusals. A value that the user is typing, and a
   * colour that the user is choosing, stay as they are.
   */
  refresh(): void {
    this.showList();
    this.sky.show(this.gltf);
    this.stale = this.typing && this.editor.contains(document.activeElement);
    if (!this.stale) this.showEditor();
  }

  private showList(): void {
    const all = hangingNodes(this.gltf);
    this.findRow.hidden = all.length <= FEW;
    const wanted = this.findRow.hidden ? '' : this.find.value.trim().toLowerCase();
    const found = wanted ? all.filter(({ node }) => nodeName(this.gltf, node).toLowerCase().includes(wanted)) : all;
    const listed = found.slice(0, MOST_LISTED).map(({ node, depth }) => ({
      node,
      depth: Math.min(depth, 8),
      name: nodeName(this.gltf, node).slice(0, MOST_LETTERS),
      visible: isVisible(this.gltf, node),
      light: lookOf(this.gltf, node) !== undefined,
    }));
    // A drag changes the document many times a second, but it does not change the list.
    const text = JSON.stringify([listed, found.length]);
    if (text !== this.listText) this.fillList(listed, found.length);
    this.listText = text;
    for (const [node, element] of this.entries)
      if (node === this.selection?.node) element.setAttribute('aria-current', 'true');
      else element.removeAttribute('aria-current');
    this.revealSelection();
  }

  private fillList(listed: ListEntry[], found: number): void {
    const had = this.list.contains(document.activeElement);
    const { scrollTop } = this.list;
    this.entries.clear();
    const items = listed.map(({ node, depth, name, visible, light }) => {
      const element = button(name, () => this.actions.select({ node, material: this.materialsOf(node)[0] }), {
        class: visible ? '' : 'hidden-node',
      });
      element.style.paddingInlineStart = `${0.5 + 0.8 * depth}rem`;
      if (light) element.append(h('span', { class: 'tag' }, 'light'));
      this.entries.set(node, element);
      return h('li', {}, element);
    });
    if (found > listed.length)
      items.push(h('li', { class: 'dim' }, `and ${found - listed.length} more: search by name`));
    if (found === 0) items.push(h('li', { class: 'dim' }, 'None found.'));
    this.list.replaceChildren(...items);
    this.list.scrollTop = scrollTop;
    if (had) this.entries.get(this.selection?.node ?? -1)?.focus();
  }

  /** Scrolls the list, and nothing but the list, to an object that was just selected or added. */
  private revealSelection(): void {
    const element = this.list.querySelector<HTMLElement>('[aria-current]')?.parentElement;
    const node = element ? this.selection?.node : undefined;
    if (node === this.revealed || this.list.clientHeight === 0) return;
    this.revealed = node;
    if (!element) return;
    const top = element.offsetTop - this.list.offsetTop;
    if (top < this.list.scrollTop || top + element.offsetHeight > this.list.scrollTop + this.list.clientHeight)
      this.list.scrollTop = top - this.list.clientHeight / 2;
  }

  /** Makes the editor's controls anew; the one that has the focus keeps it. */
  private showEditor(): void {
    const controls = () => [...this.editor.querySelectorAll<HTMLElement>('input, button')];
    const at = controls().indexOf(document.activeElement as HTMLElement);
    const [before, node] = [this.edited, this.selection?.node];
    this.typing = this.stale = false;
    this.fillEditor();
    this.edited = node;
    if (at >= 0 && before === node) controls()[at]?.focus({ preventScroll: true });
  }

  private fillEditor(): void {
    const { selection, gltf } = this;
    const node = selection && gltf.nodes?.[selection.node];
    if (!selection || !node) {
      this.editor.replaceChildren(h('p', { class: 'dim' }, 'Click an object to edit it.'));
      return;
    }
    const light = lightOf(gltf, selection.node, this.webs);
    const materials = this.materialsOf(selection.node);
    const material = selection.material ?? materials[0];
    this.editor.replaceChildren(
      section(
        nodeName(gltf, selection.node),
        field(
          'Visible',
          checkbox(isVisible(gltf, selection.node), (on) => this.actions.setVisible(selection.node, on)),
        ),
        ...this.placement(selection.node),
        buttons(
          button('Frame object', () => this.actions.frameSelection(), { title: 'Shift+F' }),
          button('Remove', () => this.actions.remove(selection.node), { title: 'Delete' }),
        ),
      ),
      ...(light ? [this.lightSection(light)] : []),
      ...(material !== undefined && gltf.materials?.[material] ? [this.materialEditor(material, materials)] : []),
    );
  }

  private placement(index: number): HTMLElement[] {
    const node = this.gltf.nodes![index]!;
    if (node.matrix) return [h('p', { class: 'dim' }, 'Placed by a skewed matrix, which cannot be edited here.')];
    const turn = new Euler().setFromQuaternion(new Quaternion(...(node.rotation ?? [0, 0, 0, 1])), 'YXZ');
    const degrees = [turn.x, turn.y, turn.z].map((a) => MathUtils.radToDeg(a)) as Vec3;
    const rows: Record<Handle, () => HTMLElement> = {
      translate: () =>
        this.vector('Position, m', node.translation ?? [0, 0, 0], (translation) =>
          this.actions.setPlacement(index, { translation }),
        ),
      rotate: () =>
        this.vector('Rotation, °', degrees, ([x, y, z]) => {
          const euler = new Euler(...([x, y, z].map((a) => MathUtils.degToRad(a)) as Vec3), 'YXZ');
          this.actions.setPlacement(index, { rotation: new Quaternion().setFromEuler(euler).toArray() as Vec4 });
        }),
      // A scale of 0 flattens a body: its front and back faces would lie in one plane.
      scale: () =>
        this.vector('Scale', node.scale ?? [1, 1, 1], (scale) => this.actions.setPlacement(index, { scale }), {
          wanted: 'a number other than 0',
          isGood: (value) => Number.isFinite(value) && value !== 0,
        }),
    };
    return handlesOf(this.gltf, index).map((handle) => rows[handle]());
  }

  private vector(label: string, value: Vec3, changed: (value: Vec3) => void, accepts = ANY_NUMBER): HTMLElement {
    // A number that nobody changed keeps its exact value, and is accepted whatever it is.
    const isKept = (input: HTMLInputElement, i: number) => input.value === briefly(value[i]!);
    const read = (input: HTMLInputElement, i: number) => (isKept(input, i) ? value[i]! : parseNumber(input.value));
    const isBad = (input: HTMLInputElement, i: number) => !isKept(input, i) && !accepts.isGood(read(input, i));
    const inputs = value.map((v, i) =>
      h('input', {
        type: 'text',
        inputMode: 'decimal',
        class: 'number',
        value: briefly(v),
        title: String(v),
        'aria-label': `${label}, ${'xyz'[i]}`,
        onchange: () => {
          const bad = inputs.find(isBad);
          if (bad) this.refuse(bad, accepts.wanted);
          else changed(inputs.map(read) as Vec3);
        },
      }),
    );
    return row(label, h('span', { class: 'vector' }, ...inputs));
  }

  private materialEditor(index: number, all: number[]): HTMLElement {
    const material = this.gltf.materials![index]!;
    const base = material.pbrMetallicRoughness?.baseColorFactor ?? [1, 1, 1, 1];
    const colour = this.colour(toHex(base), (hex) => this.actions.setColour(index, fromHex(hex)));
    const shown = emissionFields(material);
    const glow = this.colour(shown.colour, () => send());
    const nits = this.number(shown.nits, () => send());
    const send = () => {
      const written = emissionWritten(material, { colour: glow.value, nits: nits.value });
      if (!written) return this.refuse(nits, 'a number, 0 or more');
      this.actions.setEmission(index, written.factor, written.strength);
    };
    const chooser =
      all.length > 1
        ? row(
            'Material',
            h(
              'span',
              { class: 'list' },
              ...all.map((m) =>
                button(
                  materialName(this.gltf, m),
                  () => this.actions.select({ node: this.selection!.node, material: m }),
                  { 'aria-pressed': String(m === index) },
                ),
              ),
            ),
          )
        : undefined;
    return section(
      `Material: ${materialName(this.gltf, index)}`,
      chooser,
      field('Colour', colour),
      field('Emission', glow),
      field('Strength, nits', nits),
    );
  }

  private lightSection(light: NodeLight): HTMLElement {
    const colour = this.colour(toHex(light.color), (hex) => this.actions.setLight(light.colorPath, fromHex(hex)));
    return lightEditor(light, colour, this.actions, (input, wanted) => this.refuse(input, wanted));
  }

  /** Restores the field's last good value. */
  private refuse(input: HTMLInputElement, wanted = 'a number'): void {
    this.actions.notAccepted(input.value, wanted);
    this.showEditor();
  }

  /** Sends colours while the user is choosing. The gesture ends when the picker closes. */
  private colour(value: string, changed: (hex: string) => void): HTMLInputElement {
    const input = h('input', { type: 'color', value });
    input.oninput = () => changed(input.value);
    input.onchange = () => this.actions.endGesture();
    return input;
  }

  private number(value: string, changed: () => void): HTMLInputElement {
    return h('input', { type: 'text', inputMode: 'decimal', class: 'number', value, onchange: changed });
  }
}
