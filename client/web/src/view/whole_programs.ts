// Programs for scenes of which all light is there: they need not look up, for each pixel, what has come. They are made
// while the picture is at rest, and used from when they are done.

import type { Camera, Scene, WebGLRenderer } from 'three';
import type { LitScene } from './lit_scene';

/** What three.js knows of a program. */
interface Program {
  /** Asks the driver, and waits for nothing. */
  isReady(): boolean;
}

export class WholePrograms {
  private made: { scene: LitScene; programs: Program[] } | undefined;

  constructor(
    private readonly renderer: WebGLRenderer,
    private readonly camera: Camera,
    private readonly world: Scene,
  ) {}

  /** Has the driver make those of a scene, which keeps the ones that it has. Where there are such already it has them at once. */
  make(scene: LitScene): void {
    scene.specialise(true);
    this.renderer.compile(scene.root, this.camera, this.world);
    const programs = new Set<Program>();
    scene.eachMaterial((material) => {
      const { currentProgram } = this.renderer.properties.get(material) as { currentProgram?: Program };
      if (currentProgram) programs.add(currentProgram);
    });
    scene.specialise(false);
    this.made = { scene, programs: [...programs] };
  }

  /** The context is lost, and the programs with it. */
  forget(): void {
    this.made = undefined;
  }

  /** Once for every turn of the page. `isAtRest`: nobody waits for a picture. */
  turn(scene: LitScene | undefined, isAtRest: boolean): void {
    if (!scene || scene.showsWhole || !scene.set.whole) return;
    if (this.made?.scene !== scene) {
      if (isAtRest) this.make(scene);
    } else if (this.made.programs.every((program) => program.isReady())) {
      scene.showsWhole = true;
      this.made = undefined;
    }
  }
}
