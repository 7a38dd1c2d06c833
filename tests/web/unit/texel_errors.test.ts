import { TexelErrors, type LightVersion, type TexelPlace } from '../../../client/web/src/looking/texel_errors';
import type { TexelReply } from '../../../client/web/src/protocol/messages';
import { RpcError } from '../../../client/web/src/protocol/rpc';

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

const HERE = { page: 0, x: 3, y: 4 };
const THERE = { page: 0, x: 3, y: 5 };

/** A server whose answers are given by hand, and a meter that reads `at` whenever there may be more to read. */
function makeMeter(at: TexelPlace = HERE) {
  const calls: { place: TexelPlace; answer: (reply: TexelReply) => void; refuse: (error: Error) => void }[] = [];
  const meter = {
    at,
    version: { revision: 1, tileVersion: 5 } as LightVersion | undefined,
    shown: undefined as number | undefined,
    calls,
    read: () => void (meter.shown = errors.errorAt(meter.at)),
    beginSession: () => errors.forget(),
    reply: async (error: number, version: Partial<LightVersion> = {}) => {
      const reply = { irradiance: [9, 9, 9], error: [error, error, error], revision: 1, tileVersion: 5, ...version };
      calls.at(-1)!.answer(reply as TexelReply);
      await vi.advanceTimersByTimeAsync(0);
    },
  };
  const errors = new TexelErrors({
    ask: (place) => new Promise((answer, refuse) => void calls.push({ place, answer, refuse })),
    version: () => meter.version,
    changed: () => meter.read(),
  });
  return meter;
}

it('shows the error of the very texel, once it is here', async () => {
  const meter = makeMeter();
  meter.read();
  expect([meter.shown, meter.calls.map(({ place }) => place)]).toEqual([undefined, [HERE]]);
  await meter.reply(2);
  expect(meter.shown).toBeCloseTo(2, 10);
  meter.at = THERE;
  meter.read();
  expect(meter.shown).toBeUndefined();
  await vi.advanceTimersByTimeAsync(1000);
  expect(meter.calls).toHaveLength(2);
  await meter.reply(3);
  expect(meter.shown).toBeCloseTo(3, 10);
  for (let i = 0; i < 10; ++i, await vi.advanceTimersByTimeAsync(300)) meter.read();
  expect(meter.calls, 'what is known is not asked for').toHaveLength(2);
});

it('has one call under way, and makes five a second at most, of where the pointer is by then', async () => {
  const meter = makeMeter();
  const until = performance.now() + 2000;
  for (let y = 0; performance.now() < until; ++y, await vi.advanceTimersByTimeAsync(10)) {
    meter.at = { page: 0, x: 0, y };
    meter.read();
    const before = meter.calls.length;
    await vi.advanceTimersByTimeAsync(0);
    expect(meter.calls.length).toBe(before);
    if (y % 3 === 2) await meter.reply(1);
  }
  expect(meter.calls.length).toBeGreaterThan(5);
  expect(meter.calls.length).toBeLessThanOrEqual(11);
});

it('asks again for newer light, and forgets what is of another revision', async () => {
  const meter = makeMeter();
  meter.read();
  await meter.reply(2);
  meter.version = { revision: 1, tileVersion: 6 };
  await vi.advanceTimersByTimeAsync(1000);
  meter.read();
  expect([meter.shown, meter.calls.length]).toEqual([2, 2]); // it stands until the next is here
  await meter.reply(1, { tileVersion: 6 });
  expect(meter.shown).toBeCloseTo(1, 10);
  meter.version = { revision: 2, tileVersion: 6 };
  await vi.advanceTimersByTimeAsync(1000);
  meter.read();
  expect(meter.shown).toBeUndefined();
  await meter.reply(7, { revision: 1, tileVersion: 6 }); // of before the edit
  expect(meter.shown).toBeUndefined();
  await vi.advanceTimersByTimeAsync(200);
  await meter.reply(8, { revision: 2, tileVersion: 7 });
  expect(meter.shown).toBeCloseTo(8, 10);
});

it('asks nobody who cannot answer, and of what is not there once', async () => {
  const meter = makeMeter();
  meter.version = undefined;
  meter.read();
  expect(meter.calls).toHaveLength(0);
  meter.version = { revision: 1, tileVersion: 5 };
  meter.read();
  meter.calls[0]!.refuse(new RpcError(-32004, 'belongs to no surface'));
  await vi.advanceTimersByTimeAsync(2000);
  meter.read();
  expect([meter.shown, meter.calls.length]).toEqual([undefined, 1]);
  meter.at = THERE;
  meter.read();
  meter.calls[1]!.refuse(new RpcError(-32029, 'too many'));
  await vi.advanceTimersByTimeAsync(1000);
  expect(meter.calls).toHaveLength(3);
});

it('asks a server that has begun anew, whose numbers may be those of before', async () => {
  const meter = makeMeter();
  meter.read();
  await meter.reply(2, { tileVersion: 9 });
  meter.beginSession();
  meter.version = { revision: 1, tileVersion: 3 };
  await vi.advanceTimersByTimeAsync(1000);
  meter.read();
  expect([meter.shown, meter.calls.length]).toEqual([undefined, 2]);
  // An answer that was on its way when the session ended is not of the next one.
  meter.beginSession();
  await meter.reply(7, { tileVersion: 9 });
  expect(meter.shown).toBeUndefined();
});

it('asks a server that is busy less often', async () => {
  const meter = makeMeter();
  meter.read();
  for (let i = 0; i < 3; ++i) {
    meter.calls.at(-1)!.refuse(new RpcError(-32013, 'busy'));
    await vi.advanceTimersByTimeAsync(700);
    meter.read();
    expect(meter.calls).toHaveLength(i + 1);
    await vi.advanceTimersByTimeAsync(300);
    expect(meter.calls).toHaveLength(i + 2);
  }
});
