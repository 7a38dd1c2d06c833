// The head of a KTX 2.0 file (Khronos, KTX File Format Specification 2.0), and whether it holds what KHR_texture_basisu
// allows: one two-dimensional picture in ETC1S or UASTC. Reads nothing but the head, and trusts none of it.

export interface Ktx2Head {
  width: number;
  height: number;
  model: 'ETC1S' | 'UASTC';
}

/** As the server has it for pictures. */
export const MOST_PIXELS = 2 ** 26;

const IDENTIFIER = [0xab, 0x4b, 0x54, 0x58, 0x20, 0x32, 0x30, 0xbb, 0x0d, 0x0a, 0x1a, 0x0a];
const HEAD_BYTES = 80;
const LEVEL_BYTES = 24;
const MOST_SIDE = 2 ** 15;
const SCHEMES = { none: 0, basisLz: 1, zstd: 2 };
const MODELS = new Map<number, Ktx2Head['model']>([
  [163, 'ETC1S'],
  [166, 'UASTC'],
]);

/** Throws an Error that says what is wrong. */
export function readKtx2Head(file: Uint8Array): Ktx2Head {
  if (file.length < HEAD_BYTES || IDENTIFIER.some((byte, i) => file[i] !== byte)) throw new Error('is no KTX 2.0 file');
  const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
  const word = (at: number) => view.getUint32(at, true);
  const [width, height, depth, layers, faces, levels] = [20, 24, 28, 32, 36, 40].map(word) as [
    number,
    number,
    number,
    number,
    number,
    number,
  ];
  if (width === 0 || height === 0 || depth > 0 || layers > 1 || faces !== 1)
    throw new Error('is no two-dimensional picture');
  if (width > MOST_SIDE || height > MOST_SIDE || width * height > MOST_PIXELS)
    throw new Error(`claims ${width} x ${height} pixels; the limit is ${MOST_PIXELS}`);
  if (word(12) !== 0) throw new Error('is neither ETC1S nor UASTC');
  const most = 1 + Math.floor(Math.log2(Math.max(width, height)));
  if (levels > most) throw new Error(`claims ${levels} mip levels, of ${most} that there can be`);
  const model = modelOf(view);
  checkLevels(view, Math.max(1, levels), { width, height, model });
  checkPart(view, wholeNumber(view, 64), wholeNumber(view, 72), 'its global data');
  return { width, height, model };
}

function modelOf(view: DataView): Ktx2Head['model'] {
  const at = view.getUint32(48, true);
  const bytes = view.getUint32(52, true);
  checkPart(view, at, bytes, 'its description');
  const model = bytes < 16 ? undefined : MODELS.get(view.getUint8(at + 12));
  if (!model) throw new Error('is neither ETC1S nor UASTC');
  return model;
}

function checkLevels(view: DataView, levels: number, head: Ktx2Head): void {
  const scheme = view.getUint32(44, true);
  const fits = head.model === 'ETC1S' ? scheme === SCHEMES.basisLz : scheme === SCHEMES.none || scheme === SCHEMES.zstd;
  if (!fits) throw new Error(`has supercompression ${scheme}, which ${head.model} does not go with`);
  checkPart(view, HEAD_BYTES, levels * LEVEL_BYTES, 'its list of levels');
  for (let level = 0; level < levels; ++level) {
    const at = HEAD_BYTES + level * LEVEL_BYTES;
    const bytes = wholeNumber(view, at + 8);
    checkPart(view, wholeNumber(view, at), bytes, `level ${level}`);
    if (head.model === 'ETC1S') continue;
    const blocks = (pixels: number) => Math.ceil(Math.max(1, pixels >> level) / 4);
    const whole = blocks(head.width) * blocks(head.height) * 16;
    const claimed = scheme === SCHEMES.zstd ? wholeNumber(view, at + 16) : bytes;
    if (claimed !== whole) throw new Error(`level ${level} claims ${claimed} bytes of blocks, of ${whole}`);
  }
}

/** Of 64 bits; what is too large for a file is no more exact than it needs to be. */
function wholeNumber(view: DataView, at: number): number {
  return view.getUint32(at, true) + 2 ** 32 * view.getUint32(at + 4, true);
}

function checkPart(view: DataView, offset: number, bytes: number, what: string): void {
  if (offset + bytes > view.byteLength) throw new Error(`${what} lies outside of the file`);
}
