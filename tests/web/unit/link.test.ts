import { fromLink, toLink, type ShownAs } from '../../../client/web/src/view/looks/link';

const read = (hash: string) => fromLink(new URLSearchParams(hash));

describe('a link', () => {
  it('carries how a view is shown, and back', () => {
    const shown: ShownAs = { stops: -1.25, exposure: 0.01234, tone: 'agx', scale: [0.5, 2000] };
    expect(fromLink(new URLSearchParams(toLink(shown)))).toEqual(shown);
    expect(toLink(shown)).toEqual({ stops: '-1.25', exposure: '0.01234', tone: 'agx', scale: '0.5,2000' });
  });

  it('says nothing of what is as it is without one', () => {
    expect(toLink({ stops: 0, exposure: undefined, tone: 'neutral', scale: undefined })).toEqual({});
    const nothing = { stops: undefined, exposure: undefined, tone: undefined, scale: undefined };
    expect(read('')).toEqual(nothing);
    expect(read('camera=1,2,3,4,5,6,45,0&view=error')).toEqual(nothing);
  });

  it.each([
    'stops=8.25',
    'stops=-9',
    'stops=NaN',
    'stops=1e999',
    'stops=0x3',
    'stops=',
    'stops=1%2C5',
    `stops=${'1'.repeat(1000)}`,
    'exposure=0',
    'exposure=-1',
    'exposure=Infinity',
    'exposure=1e13',
    'exposure=1e-13',
    'tone=constructor',
    'tone=__proto__',
    'tone=%3Cscript%3E',
    'scale=5',
    'scale=5,5',
    'scale=9,1',
    'scale=0,1',
    'scale=-1,1',
    'scale=1,2,3',
    'scale=1,',
    'scale=1,NaN',
    'scale=1,1e13',
    `scale=${'1,'.repeat(100_000)}`,
  ])('is not believed where it says %s', (hash) => {
    expect(Object.values(read(hash)).filter((value) => value !== undefined)).toEqual([]);
  });
});
