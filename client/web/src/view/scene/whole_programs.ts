// Programs for scenes of which all light is there: they need not look up, for each pixel, what has come. They are made
// while the picture is at rest, and used from when they are done.

import type { Camera, Scene, WebGLRenderer } from 'three';
import type { Defines, ViewUniforms } from './lit_material';
import type { LitScene } from './lit_scene';

/** What three.js knows of a program. */
interface Program {
  /** Asks the driver, and waits for nothing. */
  isReady(): boolean;
}

/** For which view they are. */
interface Made {
  defines: Defines;
  programs: Program[];
}

export class WholePrograms {
  private made = new WeakMap<LitScene, Made>();

  constructor(
    private readonly renderer: WebGLRenderer,
    private readonly camera: Camera,
    private readonly world: Scene,
    private readonly view: ViewUniforms,
  ) {}

  /**
   * Has the driver make those of a scene, for the view that is chosen now. It keeps the ones that it has; where there are
   * such already it has them at once.
   */
  make(scene: LitScene): void {
    scene.specialise(true);
    this.renderer.compile(scene.root, this.camera, this.world);
    const programs = new Set<Program>();
    scene.eachMaterial((material) => {
      // All that it has: two for what is seen through from both sides.
      const { programs: its } = this.renderer.properties.get(material) as { programs?: Map<string, Program> };
      for (const program of its?.values() ?? []) programs.add(program);
    });
    scene.specialise(false);
    this.made.set(scene, { defines: this.view.wholeDefines, programs: [...programs] });
  }

  /** The context is lost, and the programs with it. */
  forget(): void {
    this.made = new WeakMap();
  }

  /** Once for every turn of the page. `isAtRest`: nobody waits for a picture. */
  turn(scene: LitScene | undefined, isAtRest: boolean): void {
    if (!scene || scene.showsWhole || !scene.set.whole) return;
    const made = this.made.get(scene);
    if (made?.defines !== this.view.wholeDefines) {
      if (isAtRest) this.make(scene);
    } else if (made.programs.every((program) => program.isReady())) {
      scene.showsWhole = true;
    }
  }
}
