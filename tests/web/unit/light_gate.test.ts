import { LightGate } from '../../../client/web/src/view/exposure/light_gate';

describe('the first light', () => {
  it('is held back until its exposure is known, and then shown', () => {
    const gate = new LightGate();
    gate.turn(0, false);
    expect([gate.isClosed(0), gate.standsStill(0)]).toEqual([false, false]);
    gate.turn(100, true);
    expect([gate.isClosed(100), gate.standsStill(100)]).toEqual([true, true]);
    gate.turn(220, true);
    expect([gate.isClosed(220), gate.standsStill(220)]).toEqual([true, true]);
    gate.turn(230, false);
    expect([gate.isClosed(230), gate.standsStill(230)]).toEqual([false, false]);
  });

  it('does not keep what moves waiting for long, and is measured on some surfaces where it does not come on all', () => {
    const gate = new LightGate();
    gate.turn(0, true);
    expect(gate.standsStill(399)).toBe(true);
    expect(gate.standsStill(400)).toBe(false);
    expect(gate.isClosed(400)).toBe(true);
    expect(gate.mayMeasure(249, false, false)).toBe(false);
    expect(gate.mayMeasure(250, false, false)).toBe(true);
  });

  it('leaves the picture of the light whose place it takes until it can be shown', () => {
    const gate = new LightGate();
    gate.turn(0, true, true);
    expect([gate.standsStill(2999), gate.standsStill(3000)]).toEqual([true, false]);
    gate.turn(500, false, true);
    expect(gate.standsStill(500)).toBe(false);
  });

  it('is measured when it is whole, and does not wait for that for long', () => {
    const gate = new LightGate();
    gate.turn(0, true);
    expect(gate.mayMeasure(0, true, true)).toBe(true);
    expect(gate.mayMeasure(59, true, false)).toBe(false);
    expect(gate.mayMeasure(60, true, false)).toBe(true);
    // All later light, as it comes.
    gate.turn(300, false);
    expect(gate.mayMeasure(300, true, false)).toBe(true);
    expect(gate.mayMeasure(9000, false, false)).toBe(false);
  });

  it('is shown after all where the card never answers', () => {
    const gate = new LightGate();
    gate.turn(0, true);
    expect(gate.isClosed(2999)).toBe(true);
    gate.turn(3000, true);
    expect(gate.isClosed(3000)).toBe(false);
    gate.turn(9000, true);
    expect(gate.isClosed(9000)).toBe(false);
  });
});
