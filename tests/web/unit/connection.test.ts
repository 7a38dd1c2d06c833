import { Connection, pauseMs, type LinkState } from '../../../client/web/src/protocol/connection';
import { CreditWindow, FIRST_WINDOW } from '../../../client/web/src/protocol/credit';
import type { Resume } from '../../../client/web/src/protocol/messages';
import { ConnectionLost, Rpc, RpcError } from '../../../client/web/src/protocol/rpc';

class FakeSocket {
  static all: FakeSocket[] = [];
  binaryType = '';
  readyState = 1;
  sent: { id?: number; method: string; params: Record<string, unknown> }[] = [];
  onmessage: ((event: { data: unknown }) => void) | undefined;
  onclose: ((event: { code: number; reason: string }) => void) | undefined;

  constructor(
    readonly url: string,
    readonly protocol: string,
  ) {
    FakeSocket.all.push(this);
  }
  send(text: string): void {
    this.sent.push(JSON.parse(text));
  }
  close(): void {
    this.drop(1000, '');
  }
  drop(code: number, reason: string): void {
    this.readyState = 3;
    this.onclose?.({ code, reason });
  }
  give(message: object): void {
    this.onmessage?.({ data: JSON.stringify({ jsonrpc: '2.0', ...message }) });
  }
  /** Answers the newest call of a method. */
  answer(method: string, result: object): void {
    this.give({
      id: this.sent.findLast((call) => call.method === method)!.id,
      result,
    });
  }
  greet(epoch = 'e1'): void {
    this.give({
      method: 'serverInfo',
      params: {
        server: 's',
        epoch,
        revision: 1,
        capabilities: ['x'],
        limits: {},
      },
    });
  }
}

function setup(resume?: () => Resume | undefined) {
  FakeSocket.all = [];
  const states: LinkState[] = [];
  const log: string[] = [];
  const connection = new Connection(
    {
      url: 'ws://host/ws',
      client: 'me',
      token: () => 'secret',
      resume: resume ?? (() => undefined),
      subscription: () => ({ quantity: 'irradiance' }),
      makeSocket: (url, protocol) => new FakeSocket(url, protocol) as unknown as WebSocket,
      random: () => 0.5,
    },
    {
      state: (state) => states.push(state),
      ready: (_, hello) => log.push(`ready ${hello.resumed}`),
      notification: (method) => log.push(method),
      tile: (frame) => log.push(`tile ${frame.byteLength}`),
    },
  );
  return { connection, states, log, socket: () => FakeSocket.all.at(-1)! };
}

const HELLO = {
  epoch: 'e1',
  revision: 1,
  tileFormat: 'rgb9e5',
  codec: 'deflate',
  creditBytes: 1,
  resumed: false,
};
const settle = () => new Promise((resolve) => setImmediate(resolve));

async function opened(test: ReturnType<typeof setup>): Promise<void> {
  test.connection.open();
  test.socket().greet();
  test.socket().answer('hello', HELLO);
  await settle();
  test.socket().answer('subscribe', {});
  await settle();
}

describe('connection', () => {
  beforeEach(() =>
    vi.useFakeTimers({
      toFake: ['setTimeout', 'clearTimeout', 'setInterval', 'clearInterval'],
    }),
  );
  afterEach(() => vi.useRealTimers());

  it('says hello after serverInfo, with token and formats, and then subscribes', async () => {
    const test = setup();
    test.connection.open();
    expect(test.socket().protocol).toBe('radiosity.v1');
    expect(test.socket().sent).toEqual([]);
    test.socket().greet();
    const hello = test.socket().sent[0]!;
    expect(hello.method).toBe('hello');
    expect(hello.params).toEqual({
      client: 'me',
      token: 'secret',
      tileFormats: ['rgb9e5', 'rgba16f'],
      codecs: ['deflate', 'none'],
      creditBytes: FIRST_WINDOW,
    });
    test.socket().answer('hello', HELLO);
    await settle();
    expect(test.socket().sent.at(-1)!.method).toBe('subscribe');
    expect(test.states).toEqual(['connecting', 'open']);
    expect(test.connection.has('x')).toBe(true);
  });

  it('sends nothing into a socket that is closing, and ends what was asked there when it is closed', async () => {
    const test = setup();
    await opened(test);
    const before = test.socket().sent.length;
    test.socket().readyState = 2;
    const lost = expect(test.connection.call('status')).rejects.toBeInstanceOf(ConnectionLost);
    test.connection.used(FIRST_WINDOW);
    expect(test.socket().sent.length).toBe(before);
    test.socket().drop(1006, '');
    await lost;
  });

  it('comes back after a loss and offers what it holds to the same epoch only', async () => {
    const test = setup(() => ({ epoch: 'e1', revision: 4, tileVersion: 9 }));
    await opened(test);
    test.socket().drop(1006, '');
    expect(test.states.at(-1)).toBe('waiting');
    expect(FakeSocket.all.length).toBe(1);
    vi.advanceTimersByTime(pauseMs(0, 0.5));
    expect(FakeSocket.all.length).toBe(2);
    test.socket().greet('e1');
    expect(test.socket().sent[0]!.params['resume']).toEqual({
      epoch: 'e1',
      revision: 4,
      tileVersion: 9,
    });
    test.socket().drop(1006, '');
    vi.advanceTimersByTime(60_000);
    test.socket().greet('e2');
    expect(test.socket().sent[0]!.params['resume']).toBeUndefined();
  });

  it('starts afresh, and ever more slowly, where it was closed for what it did not read', async () => {
    const test = setup(() => ({ epoch: 'e1', revision: 4, tileVersion: 9 }));
    const offered = () => test.socket().sent[0]!.params['resume'];
    await opened(test);
    expect(offered()).toBeDefined();
    for (let attempt = 0; attempt < 3; ++attempt) {
      test.socket().drop(1013, 'messages are not read');
      const sockets = FakeSocket.all.length;
      await vi.advanceTimersByTimeAsync(pauseMs(attempt, 0.5) - 1);
      expect(FakeSocket.all.length).toBe(sockets);
      await vi.advanceTimersByTimeAsync(1);
      expect(FakeSocket.all.length).toBe(sockets + 1);
      await opened(test);
      expect(offered()).toBeUndefined();
    }
    test.socket().give({ method: 'bookmark', params: { revision: 4, tileVersion: 9 } });
    test.socket().drop(1006, '');
    await vi.advanceTimersByTimeAsync(60_000);
    await opened(test);
    expect(offered()).toBeDefined();
  });

  it('waits longer each time, never much longer than ten seconds', () => {
    const pauses = Array.from({ length: 12 }, (_, attempt) => pauseMs(attempt, 0.5));
    expect(pauses).toEqual([...pauses].sort((a, b) => a - b));
    expect(pauses[0]).toBe(250);
    expect(pauses.at(-1)).toBe(10_000);
    expect(pauseMs(3, 0)).toBeLessThan(pauseMs(3, 1));
  });

  it('does not knock again where the token is refused', async () => {
    const test = setup();
    test.connection.open();
    test.socket().greet();
    test.socket().give({ id: test.socket().sent[0]!.id, error: { code: -32001, message: 'no or wrong token' } });
    await vi.advanceTimersByTimeAsync(0);
    test.socket().drop(1008, 'no or wrong token');
    expect(test.states.at(-1)).toBe('refused');
    vi.advanceTimersByTime(600_000);
    expect(FakeSocket.all.length).toBe(1);
  });

  it('knocks again where a busy machine said hello too late', async () => {
    const test = setup();
    test.connection.open();
    test.socket().greet();
    test.socket().drop(1008, 'hello did not come in time');
    expect(test.states.at(-1)).toBe('waiting');
    await vi.advanceTimersByTimeAsync(1000);
    expect(FakeSocket.all.length).toBe(2);
  });

  it('gives up a socket that no longer answers', async () => {
    const test = setup();
    await opened(test);
    vi.advanceTimersByTime(15_000);
    expect(test.socket().sent.at(-1)!.method).toBe('viewers');
    vi.advanceTimersByTime(8_000);
    expect(test.states.at(-1)).toBe('waiting');
  });

  it('ends calls that the loss left without an answer', async () => {
    const test = setup();
    await opened(test);
    const call = test.connection.call('status');
    test.socket().drop(1006, '');
    await expect(call).rejects.toBeInstanceOf(ConnectionLost);
  });
});

describe('rpc', () => {
  it('lets no call wait for a server that could not read one of them', async () => {
    const rpc = new Rpc({ readyState: 1, send: () => undefined }, () => undefined);
    const calls = [rpc.call('a'), rpc.call('b')];
    const refusals = calls.map((call) => expect(call).rejects.toMatchObject({ code: -32700, message: 'not JSON' }));
    rpc.receive(JSON.stringify({ jsonrpc: '2.0', id: null, error: { code: -32700, message: 'not JSON' } }));
    await Promise.all(refusals);
    rpc.receive(JSON.stringify({ jsonrpc: '2.0', id: 1, result: 1 })); // comes late
  });

  it('matches answers by id, not by order, also in batches', async () => {
    const sent: { id: number }[] = [];
    const notes: string[] = [];
    const rpc = new Rpc({ readyState: 1, send: (text) => void sent.push(JSON.parse(text)) }, (method) =>
      notes.push(method),
    );
    const [a, b] = [rpc.call<number>('a'), rpc.call<number>('b')];
    rpc.receive(
      JSON.stringify([
        { jsonrpc: '2.0', id: sent[1]!.id, result: 2 },
        { jsonrpc: '2.0', method: 'note' },
      ]),
    );
    rpc.receive(
      JSON.stringify({
        jsonrpc: '2.0',
        id: sent[0]!.id,
        error: { code: -32009, message: 'late', data: { revision: 9 } },
      }),
    );
    expect(await b).toBe(2);
    await expect(a).rejects.toEqual(new RpcError(-32009, 'late', { revision: 9 }));
    expect(notes).toEqual(['note']);
  });

  it('drops what is no message', () => {
    const rpc = new Rpc({ readyState: 1, send: () => undefined }, () => expect.unreachable());
    for (const text of ['', '{', '7', 'null', '[]', '[null]', '{"id":99,"result":1}']) rpc.receive(text);
  });
});

describe('credit', () => {
  it('is given back in quarters, and never more than was used', () => {
    const credit = new CreditWindow();
    let given = 0;
    let used = 0;
    for (let i = 0; i < 1000; ++i) {
      used += 10_000;
      given += credit.used(10_000);
      expect(given).toBeLessThanOrEqual(used);
      expect(used - given).toBeLessThan(FIRST_WINDOW / 4);
    }
  });

  /** Frames of so many bytes, all of which the page uses at once. */
  const run = (bytes: number, everyMs: number) => {
    const credit = new CreditWindow();
    for (let t = 0; t < 10_000; t += everyMs) {
      credit.received(bytes, t);
      credit.used(bytes);
    }
    return credit;
  };

  it('shrinks on a slow network and grows on a quick one', () => {
    for (const [bytes, everyMs] of [
      [16_000, 400], // 40 kB/s: less than the window in any time that is measured
      [16_000, 100],
      [16_000, 20],
      [64_000, 2],
    ] as const) {
      const { rate } = run(bytes, everyMs);
      expect(rate / ((1000 * bytes) / everyMs)).toBeGreaterThan(0.95);
      expect(rate / ((1000 * bytes) / everyMs)).toBeLessThan(1.05);
    }
  });

  it('does not take a page that is slow to draw for a slow network', () => {
    const credit = new CreditWindow();
    let free = FIRST_WINDOW; // what the server may send, which it does at once
    for (let t = 0; t < 20_000; t += 100) {
      while (free >= 16_000) {
        credit.received(16_000, t);
        free -= 16_000;
      }
      free += credit.used(16_000); // 160 kB/s
    }
    expect(credit.rate).toBe(0);
  });

  it('does not take a page that is busy with something else for a slow network', () => {
    const credit = new CreditWindow();
    for (let i = 0, t = 0; i < 30; ++i, t += i === 10 ? 600 : 1) {
      credit.received(16_000, t);
      credit.used(16_000);
    }
    credit.idle();
    expect(credit.rate).toBe(0);
  });

  it('does not take what lay in buffers meanwhile for a quick network', () => {
    const credit = new CreditWindow();
    // 1 MB/s: a frame every 16 ms, but for a page that is busy for 0.6 of 4 s, and then finds 37 of them at once.
    for (let due = 0; due < 20_000; due += 16) {
      const inRound = due % 4000;
      credit.received(16_000, inRound > 3400 ? due - inRound + 4000 : due);
      credit.used(16_000);
    }
    expect(credit.rate).toBeGreaterThan(900_000);
    expect(credit.rate).toBeLessThan(1_100_000);
  });

  it('grows where the server waits for the page, and all comes at once', () => {
    const credit = new CreditWindow();
    let free = FIRST_WINDOW;
    let most = 0;
    for (let t = 0; t < 5000; t += 50) {
      let came = 0;
      for (; free >= 16_000; free -= 16_000, came += 16_000) credit.received(16_000, t);
      free += credit.used(came);
      most = Math.max(most, free);
    }
    expect(most).toBeGreaterThan(4 * FIRST_WINDOW);
  });

  it('learns nothing from the pauses between one version of the light and the next', () => {
    const credit = new CreditWindow();
    for (let t = 0; t < 20_000; t += 300) {
      credit.received(16_000, t);
      credit.used(16_000);
      credit.idle();
    }
    expect(credit.rate).toBe(0);
  });
});
