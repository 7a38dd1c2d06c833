// What a link says of how a view is shown, beside its camera: text behind the # of an address, and back. Anybody may have
// written it: what is not sound counts as not said. Pure.

import { TONE_CURVES } from './view_modes';

export const MOST_STOPS = 8;
/** Of a manual exposure, and of either end of a scale: nothing that anybody measures is beyond. */
const LEAST = 1e-12;
const MOST = 1e12;

/** Undefined: as it is without a link. */
export interface ShownAs {
  /** Steps of two, added to the exposure. */
  stops?: number | undefined;
  /** A manual exposure, before those steps: what radiance in nits is multiplied by. */
  exposure?: number | undefined;
  /** Of TONE_CURVES. */
  tone?: string | undefined;
  /** Lowest and highest value of the false colours, where they do not follow the light. */
  scale?: [number, number] | undefined;
}

const brief = (value: number) => String(Number(value.toPrecision(4)));

/** Members of the hash; what is as it is without a link is left out. */
export function toLink({ stops, exposure, tone, scale }: ShownAs): Record<string, string> {
  return {
    ...(stops ? { stops: brief(stops) } : {}),
    ...(exposure === undefined ? {} : { exposure: brief(exposure) }),
    ...(tone === undefined || tone === TONE_CURVES[0].id ? {} : { tone }),
    ...(scale ? { scale: scale.map(brief).join(',') } : {}),
  };
}

export function fromLink(link: URLSearchParams): ShownAs {
  const tone = link.get('tone');
  return {
    stops: numberIn(link.get('stops'), -MOST_STOPS, MOST_STOPS),
    exposure: numberIn(link.get('exposure'), LEAST, MOST),
    tone: TONE_CURVES.find(({ id }) => id === tone)?.id,
    scale: scaleOf(link.get('scale')),
  };
}

function scaleOf(text: string | null): [number, number] | undefined {
  const ends = text?.split(',', 3).map((end) => numberIn(end, LEAST, MOST));
  const [low, high] = ends ?? [];
  return ends?.length === 2 && low && high && low < high ? [low, high] : undefined;
}

/** Written in digits, and within bounds. */
function numberIn(text: string | null, least: number, most: number): number | undefined {
  if (!text || text.length > 24 || !/^-?\d*\.?\d+(e[+-]?\d+)?$/i.test(text)) return undefined;
  const value = Number(text);
  return value >= least && value <= most ? value : undefined;
}
