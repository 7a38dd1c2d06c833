// What a browser keeps for the next visit, or for this tab, where it keeps anything: one that blocks cookies refuses with
// an exception, which must not take the page with it.

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
    // Then it holds until the page is left.
  }
}
