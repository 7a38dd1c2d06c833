// How a link describes a view, apart from its camera: the text behind the # of an address. Anybody may have written a
// link, so unsound values are ignored. Pure.

import { TONE_CURVES } from './view_modes';

export const MOST_STOPS = 8;
/** Bounds of a manual exposure and of a scale; no measured value lies beyond them. */
const LEAST = 1e-12;
const MOST = 1e12;

/** Undefined members have their defaults. */
export interface ShownAs {
  /** Steps of two, added to the exposure. */
  stops?: number | undefined;
  /** A manual exposure, before those steps: what radiance in nits is multiplied by. */
  exposure?: number | undefined;
  /** Id of one of TONE_CURVES. */
  tone?: string | undefined;
  /** Lowest and highest value of the false colours; undefined: the scale follows the light. */
  scale?: [number, number] | undefined;
}

const brief = (value: number) => String(Number(value.toPrecision(4)));

/** Members of the hash, without those that have their defaults. */
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

/** A number in digits, within bounds; undefined: the text is none. */
function numberIn(text: string | null, least: number, most: number): number | undefined {
  if (!text || text.length > 24 || !/^-?\d*\.?\d+(e[+-]?\d+)?$/i.test(text)) return undefined;
  const value = Number(text);
  return value >= least && value <= most ? value : undefined;
}
