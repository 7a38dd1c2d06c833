// Values that the browser keeps for the next visit or for this tab. A browser that blocks cookies throws an exception
// instead, which must not end the page.

type Shelf = 'local' | 'session';

function shelf(of: Shelf): Storage {
  return of === 'local' ? localStorage : sessionStorage;
}

export function stored(key: string, of: Shelf = 'local'): string | undefined {
  try {
    return shelf(of).getItem(key) ?? undefined;
  } catch {
    return undefined;
  }
}

export function store(key: string, value: string, of: Shelf = 'local'): void {
  try {
    shelf(of).setItem(key, value);
  } catch {
    // The value then holds until the page is closed.
  }
}
