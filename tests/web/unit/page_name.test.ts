import { PageName, shownName } from '../../../client/web/src/protocol/page_name';

describe('the name of a page', () => {
  it('is what its user is called, with a mark that others are not shown', () => {
    const name = new PageName('  Ann\u0007 Lee ');
    expect(name.client).toMatch(/^Ann  Lee \([a-z0-9]{4}\)$/);
    expect(shownName(name.client)).toBe('Ann  Lee');
    expect(shownName('curl/7.88.1')).toBe('curl/7.88.1');
    expect(shownName('script (nightly)')).toBe('script (nightly)');
  });

  it('is shown so that it changes nothing of the text around it, however it is written', () => {
    expect(shownName('\u202eAnn\u2066\n')).toBe('Ann');
    expect(shownName(' \t\u200f')).toBe('');
    expect(new PageName('\u202eAnn').person).toBe('Ann');
    expect(shownName('x'.repeat(256))).toBe(`${'x'.repeat(60)}…`);
  });

  it('is one of its own where that is not said', () => {
    const name = new PageName('');
    expect(name.client).toMatch(/^viewer [a-z0-9]{4}$/);
    expect(shownName(name.client)).toBe(name.client);
  });

  it('knows its own edits, by earlier names too, and none of another page of the same user', () => {
    const [name, other] = [new PageName(''), new PageName('Ann')];
    const before = name.client;
    name.person = 'Ann';
    expect([before, name.client, other.client, 'Ann', ''].map((by) => name.isMine(by))).toEqual([true, true, false, false, false]); // prettier-ignore
  });

  it('stays within what the protocol allows', () => {
    expect(new TextEncoder().encode(new PageName('😀'.repeat(500)).client).length).toBeLessThanOrEqual(256);
  });
});
