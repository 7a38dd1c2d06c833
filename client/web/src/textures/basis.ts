// Decodes KTX 2.0 pictures with the transcoder of Basis Universal, as three.js ships it.
import { readKtx2Head } from './ktx2';

export interface Pixels {
  width: number;
  height: number;
  rgba: Uint8Array; // row by row, as the file has them: neither colour space nor alpha is touched
}

/** What the transcoder's script makes. */
export type BasisFactory = (module: {
  wasmBinary: ArrayBuffer;
  printErr?: (text: string) => void;
  onRuntimeInitialized?: () => void;
}) => unknown;

interface Ktx2File {
  isValid(): boolean;
  isHDR(): boolean;
  getWidth(): number;
  getHeight(): number;
  startTranscoding(): number;
  getImageTranscodedSizeInBytes(level: number, layer: number, face: number, format: number): number;
  transcodeImage(
    to: Uint8Array,
    level: number,
    layer: number,
    face: number,
    format: number,
    flags: number,
    channel0: number,
    channel1: number,
  ): number;
  close(): void;
  delete(): void;
}

interface BasisModule {
  initializeBasis(): void;
  KTX2File: new (file: Uint8Array) => Ktx2File;
}

const RGBA32 = 13;

export type Decode = (file: Uint8Array) => Pixels;

/** The function that this resolves to throws an Error that says what is wrong with a file. */
export async function makeDecoder(basis: BasisFactory, wasmBinary: ArrayBuffer): Promise<Decode> {
  const module = await new Promise<BasisModule>((resolve) => {
    const made = { wasmBinary, printErr: () => undefined, onRuntimeInitialized: () => resolve(made as never) };
    basis(made);
  });
  module.initializeBasis();
  return (bytes) => {
    const { width, height } = readKtx2Head(bytes);
    const file = new module.KTX2File(bytes);
    try {
      if (!file.isValid() || file.isHDR() || file.getWidth() !== width || file.getHeight() !== height)
        throw new Error('is no sound KTX 2.0 file of ETC1S or UASTC');
      if (!file.startTranscoding()) throw new Error('cannot be unpacked: its data is damaged');
      const rgba = new Uint8Array(4 * width * height);
      if (file.getImageTranscodedSizeInBytes(0, 0, 0, RGBA32) !== rgba.length)
        throw new Error('cannot be unpacked: its size is not what its head says');
      if (!file.transcodeImage(rgba, 0, 0, 0, RGBA32, 0, -1, -1))
        throw new Error('cannot be unpacked: its data is damaged');
      return { width, height, rgba };
    } finally {
      file.close();
      file.delete();
    }
  };
}
