// The scene's GLSL programs, which the driver compiles while the page goes on. A scene of which all light has arrived
// gets programs that need not look up, for each pixel, which light is there: they are made while the picture is at
// rest.

import type { Camera, Scene, WebGLRenderer } from 'three';
import { pause } from '../../page/pause';
import type { Defines, ViewUniforms } from './lit_material';
import type { LitScene } from './lit_scene';

/** A driver that never reports that it is done (a lost context) holds nothing up for longer. */
const MOST_COMPILING_MS = 2000;

/** What three.js knows of a program. */
interface Program {
  /** Asks the driver without waiting. */
  isReady(): boolean;
}

/** Programs of a scene for pages of which all light is there, and the view that they are for. */
interface Whole {
  defines: Defines;
  programs: Program[];
}

export class Programs {
  private whole = new WeakMap<LitScene, Whole>();
  private compiling = false;

  constructor(
    private readonly renderer: WebGLRenderer,
    private readonly camera: Camera,
    private readonly world: Scene,
    private readonly view: ViewUniforms,
  ) {}

  /** Ends when the driver has made the scene's programs, or at once where it cannot make them in the background. */
  async compile(scene: LitScene): Promise<void> {
    if (!this.renderer.extensions.has('KHR_parallel_shader_compile')) return;
    const compiled = this.renderer.compileAsync(scene.root, this.camera, this.world);
    await Promise.race([compiled, pause(MOST_COMPILING_MS)]);
  }

  /**
   * Makes the programs of the view that is chosen now, where the scene has those of another. Returns whether programs
   * are being made, so that the last picture must stay; calls `done` when they are there.
   */
  recompile(scene: LitScene | undefined, done: () => void): boolean {
    if (this.compiling || !scene?.specialise()) return this.compiling;
    this.compiling = true;
    void this.compile(scene).finally(() => {
      this.compiling = false;
      done();
    });
    return true;
  }

  /**
   * Starts to make the programs for whole pages, in the view that is chosen now. The scene keeps the programs that it
   * has. Where three.js has such programs already, they are there at once.
   */
  makeWhole(scene: LitScene): void {
    scene.specialise(true);
    this.renderer.compile(scene.root, this.camera, this.world);
    const programs = new Set<Program>();
    scene.eachMaterial((material) => {
      // A material that is seen through from both sides has two.
      const { programs: its } = this.renderer.properties.get(material) as { programs?: Map<string, Program> };
      for (const program of its?.values() ?? []) programs.add(program);
    });
    scene.specialise(false);
    this.whole.set(scene, { defines: this.view.wholeDefines, programs: [...programs] });
  }

  /** The context is lost, and the programs with it. */
  forget(): void {
    this.whole = new WeakMap();
  }

  /** Once a turn of the page. `isAtRest`: nobody waits for a picture. */
  turn(scene: LitScene | undefined, isAtRest: boolean): void {
    if (!scene || scene.showsWhole || !scene.set.whole) return;
    const whole = this.whole.get(scene);
    if (whole?.defines !== this.view.wholeDefines) {
      if (isAtRest && !this.compiling) this.makeWhole(scene);
    } else if (whole.programs.every((program) => program.isReady())) {
      scene.showsWhole = true;
    }
  }
}
