// The sign of a measuring plane: its edge, and the light at its points as false colours with numbers.

import {
  BufferGeometry,
  CanvasTexture,
  DoubleSide,
  Float32BufferAttribute,
  LinearSRGBColorSpace,
  LineBasicMaterial,
  LineLoop,
  Mesh,
  MeshBasicMaterial,
  Object3D,
} from 'three';
import type { PlaneSpec } from '../../document/planes';
import type { MeasuredPlane } from '../../protocol/messages';
import { paletteColour } from '../looks/palette';

/** Pixels of the longer side of the grid's picture, and of a cell. */
const MOST_PIXELS = 1024;
const MOST_CELL_PIXELS = 96;
/** In smaller cells numbers cannot be read. */
const LEAST_FOR_NUMBERS = 26;
const OPACITY = 0.85;

/** From above, +X to the right and +Z towards the viewer, the picture of the grid is upright. */
function quad(): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute(
    'position',
    new Float32BufferAttribute([-0.5, 0, -0.5, 0.5, 0, -0.5, 0.5, 0, 0.5, -0.5, 0, 0.5], 3),
  );
  geometry.setAttribute('uv', new Float32BufferAttribute([0, 1, 1, 1, 1, 0, 0, 0], 2));
  geometry.setIndex([0, 3, 2, 0, 2, 1]);
  return geometry;
}

const QUAD = quad();
/** The corners alone: lines would follow the triangles. */
const EDGE = quad().setIndex(null);

/** Three digits are as many as anyone reads. */
export function cellText(value: number): string {
  return value >= 100 ? value.toFixed(0) : value >= 10 ? value.toFixed(1) : value.toFixed(2);
}

function drawGrid({ columns, rows, lux = [], maximum }: MeasuredPlane): HTMLCanvasElement | undefined {
  const cell = Math.max(1, Math.min(MOST_CELL_PIXELS, Math.floor(MOST_PIXELS / Math.max(columns, rows))));
  if (Math.max(columns, rows) > MOST_PIXELS) return undefined; // wider than textures are
  const canvas = document.createElement('canvas');
  canvas.width = columns * cell;
  canvas.height = rows * cell;
  const context = canvas.getContext('2d');
  if (!context || lux.length < columns * rows) return undefined;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.font = `${Math.round(0.3 * cell)}px sans-serif`;
  const most = Math.max(maximum, ...lux.slice(0, 1), 1e-12);
  for (let i = 0; i < columns * rows; ++i) {
    const [x, y] = [(i % columns) * cell, Math.floor(i / columns) * cell];
    const part = lux[i]! / most;
    const [r, g, b] = paletteColour(part).map((c) => Math.round(255 * c));
    context.fillStyle = `rgb(${r} ${g} ${b})`;
    context.fillRect(x, y, cell, cell);
    if (cell < LEAST_FOR_NUMBERS) continue;
    context.fillStyle = part > 0.6 ? '#000' : '#fff';
    context.fillText(cellText(lux[i]!), x + cell / 2, y + cell / 2);
  }
  return canvas;
}

export class PlaneMarker extends Object3D {
  private readonly line = new LineBasicMaterial({ toneMapped: false });
  private readonly fill = new MeshBasicMaterial({
    toneMapped: false,
    side: DoubleSide,
    transparent: true,
    opacity: OPACITY,
    depthWrite: false,
  });
  private readonly shape = new Object3D();
  private readonly grid = new Mesh(QUAD, this.fill);
  private measured: MeasuredPlane | undefined;

  constructor(readonly node: number) {
    super();
    this.line.color.setRGB(0.2, 0.8, 0.9, LinearSRGBColorSpace);
    this.shape.add(this.grid, new LineLoop(EDGE, this.line));
    this.add(this.shape);
    this.grid.visible = false;
  }

  /** `measured`: undefined where the light on the plane is not known. */
  display({ width, depth, margin = 0 }: PlaneSpec, measured: MeasuredPlane | undefined): void {
    this.shape.scale.set(width - 2 * margin, 1, depth - 2 * margin);
    if (measured !== this.measured) this.paint(measured);
    this.updateMatrixWorld(true);
  }

  private paint(measured: MeasuredPlane | undefined): void {
    this.measured = measured;
    this.fill.map?.dispose();
    const canvas = measured && drawGrid(measured);
    this.fill.map = canvas ? new CanvasTexture(canvas) : null;
    this.fill.needsUpdate = true;
    this.grid.visible = canvas !== undefined;
  }

  destroy(): void {
    this.fill.map?.dispose();
    this.fill.dispose();
    this.line.dispose();
    this.removeFromParent();
  }
}
