// Listens to keys outside of text fields.

export interface KeyActions {
  camera(event: KeyboardEvent, down: boolean): boolean;
  turn(right: number, up: number): void;
  zoom(factor: number): void;
  /** A key by its name ("f", "F", "?"). False: the key has no meaning. */
  press(key: string, event: KeyboardEvent): boolean;
}

const STEP = 0.06;
const TURNS: Record<string, [number, number]> = {
  ArrowLeft: [-STEP, 0],
  ArrowRight: [STEP, 0],
  ArrowUp: [0, STEP],
  ArrowDown: [0, -STEP],
};

export function listenToKeys(canvas: HTMLCanvasElement, actions: KeyActions): void {
  window.addEventListener('keydown', (event) => {
    if (isTyping(event.target)) return;
    const onPage = event.target === canvas || event.target === document.body;
    const turn = TURNS[event.key];
    if (turn && onPage && !event.altKey) actions.turn(...turn);
    else if ((event.key === '+' || event.key === '=') && onPage) actions.zoom(0.9);
    else if (event.key === '-' && onPage) actions.zoom(1.11);
    // Space and Enter press a button that has the focus.
    else if ((event.key === ' ' || event.key === 'Enter') && !onPage) return;
    else if (!actions.camera(event, true) && !actions.press(event.key, event)) return;
    event.preventDefault();
  });
  window.addEventListener('keyup', (event) => actions.camera(event, false));
}

function isTyping(target: EventTarget | null): boolean {
  if (target instanceof HTMLInputElement) return !['checkbox', 'button', 'range', 'color'].includes(target.type);
  return (
    target instanceof HTMLTextAreaElement ||
    target instanceof HTMLSelectElement ||
    document.querySelector('dialog[open]') !== null
  );
}
