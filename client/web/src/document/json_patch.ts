// JSON Patch (RFC 6902) with the server's names of elements (/nodes/@lamp), and the inverse of each patch. The
// functions change nothing but the given document.

import type { Json, Patch, PatchOperation } from '../protocol/messages';

export class PatchError extends Error {}

interface Place {
  parent: Json[] | { [member: string]: Json };
  key: string;
}

export function parsePointer(pointer: string): string[] {
  if (pointer === '') return [];
  if (!pointer.startsWith('/')) throw new PatchError(`${pointer} is not a JSON pointer`);
  return pointer
    .slice(1)
    .split('/')
    .map((token) => {
      if (/~(?![01])/.test(token)) throw new PatchError(`${pointer}: ~ must be written ~0`);
      return token.replaceAll('~1', '/').replaceAll('~0', '~');
    });
}

export function formatPointer(tokens: readonly (string | number)[]): string {
  return tokens.map((token) => '/' + String(token).replaceAll('~', '~0').replaceAll('/', '~1')).join('');
}

/** The pointer with indices in place of unique names of elements: /nodes/@lamp becomes /nodes/3. */
export function withoutNames(document: Json, pointer: string): string {
  const tokens = parsePointer(pointer);
  let at: Json | undefined = document;
  for (let i = 0; i < tokens.length; ++i) {
    const token = tokens[i]!;
    if (Array.isArray(at) && token.startsWith('@')) {
      const named = at.flatMap((e, k) => (isObject(e) && e['name'] === token.slice(1) ? [k] : []));
      if (named.length !== 1) throw new PatchError(`${pointer}: ${named.length} elements are called ${token.slice(1)}`);
      tokens[i] = String(named[0]);
    }
    at = child(at, tokens[i]!);
  }
  return formatPointer(tokens);
}

/** The value at a pointer; undefined where there is none. */
export function valueAt(document: Json, pointer: string): Json | undefined {
  let at: Json | undefined = document;
  for (const token of parsePointer(pointer)) at = child(at, token);
  return at;
}

export function isObject(value: unknown): value is { [member: string]: Json } {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

function child(value: Json | undefined, token: string): Json | undefined {
  if (Array.isArray(value)) return /^(0|[1-9]\d*)$/.test(token) ? value[Number(token)] : undefined;
  return isObject(value) && Object.hasOwn(value, token) ? value[token] : undefined;
}

function placeOf(document: Json, pointer: string): Place {
  const tokens = parsePointer(pointer);
  const key = tokens.pop();
  if (key === undefined) throw new PatchError('a patch cannot replace the whole document');
  let at: Json | undefined = document;
  for (const token of tokens) at = child(at, token);
  if (!Array.isArray(at) && !isObject(at)) throw new PatchError(`${pointer}: its parent does not exist`);
  return { parent: at, key };
}

function indexIn(array: Json[], key: string, pointer: string, end: number): number {
  const index = key === '-' ? array.length : /^(0|[1-9]\d*)$/.test(key) ? Number(key) : NaN;
  if (!(index <= end)) throw new PatchError(`${pointer} is outside its array`);
  return index;
}

/** Defines an own member, even one that is called __proto__. */
function setMember(object: { [member: string]: Json }, key: string, value: Json): void {
  Object.defineProperty(object, key, { value, enumerable: true, writable: true, configurable: true });
}

function add(document: Json, pointer: string, value: Json): PatchOperation {
  const { parent, key } = placeOf(document, pointer);
  if (Array.isArray(parent)) {
    const index = indexIn(parent, key, pointer, parent.length);
    parent.splice(index, 0, value);
    return { op: 'remove', path: pointer.slice(0, pointer.lastIndexOf('/') + 1) + index };
  }
  const before = Object.hasOwn(parent, key) ? parent[key] : undefined;
  setMember(parent, key, value);
  return before === undefined ? { op: 'remove', path: pointer } : { op: 'replace', path: pointer, value: before };
}

function remove(document: Json, pointer: string): { removed: Json; inverse: PatchOperation } {
  const { parent, key } = placeOf(document, pointer);
  const removed = existing(parent, key, pointer);
  if (Array.isArray(parent)) parent.splice(Number(key), 1);
  else delete parent[key];
  return { removed, inverse: { op: 'add', path: pointer, value: removed } };
}

function existing(parent: Place['parent'], key: string, pointer: string): Json {
  const value = child(parent, key);
  if (value === undefined) throw new PatchError(`${pointer} does not exist`);
  return value;
}

function replace(document: Json, pointer: string, value: Json): PatchOperation {
  const { parent, key } = placeOf(document, pointer);
  const before = existing(parent, key, pointer);
  if (Array.isArray(parent)) parent[Number(key)] = value;
  else setMember(parent, key, value);
  return { op: 'replace', path: pointer, value: before };
}

export function sameJson(a: Json | undefined, b: Json | undefined): boolean {
  if (a === b) return true;
  if (Array.isArray(a)) return Array.isArray(b) && a.length === b.length && a.every((v, i) => sameJson(v, b[i]));
  if (!isObject(a) || !isObject(b)) return false;
  const keys = Object.keys(a);
  return keys.length === Object.keys(b).length && keys.every((k) => Object.hasOwn(b, k) && sameJson(a[k], b[k]));
}

function copied(operation: PatchOperation): Json {
  if (operation.value === undefined) throw new PatchError(`${operation.path}: ${operation.op} without a value`);
  return structuredClone(operation.value);
}

function sourceOf(operation: PatchOperation): string {
  if (operation.from === undefined) throw new PatchError(`${operation.path}: ${operation.op} without a source`);
  return operation.from;
}

/** Changes the document by one operation. Returns the operations that undo it, in order. */
function applyOperation(document: Json, operation: PatchOperation): Patch {
  const path = withoutNames(document, operation.path);
  switch (operation.op) {
    case 'add':
      return [add(document, path, copied(operation))];
    case 'remove':
      return [remove(document, path).inverse];
    case 'replace':
      return [replace(document, path, copied(operation))];
    case 'copy': {
      const value = valueAt(document, withoutNames(document, sourceOf(operation)));
      if (value === undefined) throw new PatchError(`${operation.from} does not exist`);
      return [add(document, path, structuredClone(value))];
    }
    case 'move': {
      const from = withoutNames(document, sourceOf(operation));
      if (path.startsWith(from + '/')) throw new PatchError(`${from} cannot be moved into itself`);
      const { removed, inverse } = remove(document, from);
      return [add(document, path, removed), inverse];
    }
    case 'test':
      if (operation.value === undefined || !sameJson(valueAt(document, path), operation.value))
        throw new PatchError(`${path} does not have the value that the patch expects`);
      return [];
    default:
      throw new PatchError(`${String(operation.op)} is not a JSON Patch operation`);
  }
}

/** Applies the whole patch or nothing of it. Returns the patch that undoes it. Throws PatchError. */
export function applyPatch(document: Json, patch: Patch): Patch {
  const steps: Patch[] = [];
  const inverse = () => steps.reverse().flat();
  try {
    for (const operation of patch) steps.push(applyOperation(document, operation));
  } catch (error) {
    for (const operation of inverse()) applyOperation(document, operation);
    throw error;
  }
  return inverse();
}
