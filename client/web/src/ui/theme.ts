// The button that chooses the page's colours: dark, light, or as the system has them.

import { button } from '../page/dom';
import { store, stored } from '../page/stored';

const THEMES = ['auto', 'dark', 'light'] as const;

export function themeButton(): HTMLButtonElement {
  let theme = stored('theme') ?? 'auto';
  const system = matchMedia('(prefers-color-scheme: light)');
  const apply = () => {
    document.documentElement.dataset['theme'] = theme !== 'auto' ? theme : system.matches ? 'light' : 'dark';
    element.textContent = theme === 'auto' ? '◐' : theme === 'dark' ? '☾' : '☀';
    element.title = `Theme: ${theme}`;
    element.setAttribute('aria-label', element.title);
  };
  const choose = () => {
    theme = THEMES[(THEMES.indexOf(theme as (typeof THEMES)[number]) + 1) % THEMES.length]!;
    store('theme', theme);
    apply();
  };
  const element: HTMLButtonElement = button('', choose, { class: 'icon' });
  system.addEventListener('change', apply);
  apply();
  return element;
}
