import { DocumentFetch } from '../../../client/web/src/document/document_fetch';

/** A server whose answers come when the test says so. */
function server() {
  const asked: { answer(revision: number): Promise<void>; fail(): Promise<void>; signal: AbortSignal }[] = [];
  const taken: number[] = [];
  let failures = 0;
  const settled = () => new Promise<void>((resolve) => setTimeout(resolve));
  const fetch = new DocumentFetch({
    ask: (signal) =>
      new Promise((resolve, reject) => {
        asked.push({
          signal,
          answer: (revision) => (resolve({ revision, take: () => void taken.push(revision) }), settled()),
          fail: () => (reject(new Error('no')), settled()),
        });
      }),
    failed: () => void ++failures,
  });
  return { fetch, asked, taken, failures: () => failures };
}

describe('the whole document', () => {
  it('is asked for once while it is on its way, however many edits do not fit meanwhile', async () => {
    const { fetch, asked, taken } = server();
    for (let revision = 2; revision <= 40; ++revision) fetch.want(revision);
    expect(asked.length).toBe(1);
    await asked[0]!.answer(41);
    expect(asked.length).toBe(1);
    expect(taken).toEqual([41]);
    expect(fetch.isOwed).toBe(false);
  });

  it('is asked for again where what comes is older than what was told meanwhile', async () => {
    const { fetch, asked, taken } = server();
    fetch.want(2);
    fetch.want(9);
    await asked[0]!.answer(8);
    expect(asked.length).toBe(2);
    await asked[1]!.answer(12);
    expect(asked.length).toBe(2);
    expect(taken).toEqual([8, 12]);
  });

  it('of another scene is asked for again, whatever is on its way', async () => {
    const { fetch, asked, taken } = server();
    fetch.want();
    fetch.want();
    await asked[0]!.answer(1_000);
    expect(asked.length).toBe(2);
    await asked[1]!.answer(1_001);
    expect(taken).toEqual([1_000, 1_001]);
  });

  it('of a connection that is gone is not taken, and stays owed', async () => {
    const { fetch, asked, taken, failures } = server();
    fetch.want();
    fetch.want(5);
    fetch.forget();
    expect(asked[0]!.signal.aborted).toBe(true);
    await asked[0]!.answer(7);
    expect(taken).toEqual([]);
    expect(asked.length).toBe(1);
    expect(fetch.isOwed).toBe(true);
    // What the old one has to say comes after the new one is on its way.
    fetch.want();
    expect(asked.length).toBe(2);
    await asked[0]!.fail();
    await asked[1]!.answer(1);
    expect(taken).toEqual([1]);
    expect(failures()).toBe(0);
    expect(fetch.isOwed).toBe(false);
  });

  it('is asked for again after a failure where an edit has not fitted meanwhile, and is owed where not', async () => {
    const { fetch, asked, failures } = server();
    fetch.want(2);
    fetch.want(3);
    await asked[0]!.fail();
    expect(asked.length).toBe(2);
    await asked[1]!.fail();
    expect(asked.length).toBe(2);
    expect(failures()).toBe(2);
    expect(fetch.isOwed).toBe(true);
  });
});
