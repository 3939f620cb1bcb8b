// The full-coordinate simulation's bodies, where the program says they are.
import * as THREE from 'three';
import type { PoseLists } from '../poses/gpu';
import { listTexture, numbers } from '../poses/lists';
import type { GhostFrame, SceneMessage } from '../wire/messages';
import { Ghost } from './ghost';
import type { PosedUniforms } from './posed_material';
import type { Batch } from './shapes';

const TONE = 0x8a63c4;

export class FullGhost {
  readonly ghost: Ghost;
  private quaternions = listTexture(1);
  private positions = listTexture(1);

  constructor(styles: PosedUniforms['styles']) {
    this.ghost = new Ghost(styles, TONE, 0.38);
  }

  use(scene: SceneMessage, batches: readonly Batch[]): void {
    this.quaternions.dispose();
    this.positions.dispose();
    const bodies = scene.bodies.length;
    this.quaternions = listTexture(bodies);
    this.positions = listTexture(bodies);
    const lists: PoseLists = { quaternions: this.quaternions, positions: this.positions, bodies, copies: 1 };
    this.ghost.use(lists, batches);
  }

  set(frame: GhostFrame): void {
    const q = numbers(this.quaternions);
    const p = numbers(this.positions);
    for (let b = 0; 7 * b < frame.poses.length; ++b) {
      const [x = 0, y = 0, z = 0, qw = 1, qx = 0, qy = 0, qz = 0] = frame.poses.subarray(7 * b, 7 * b + 7);
      q.set([qx, qy, qz, qw], 4 * b);
      p.set([x, y, z, 1], 4 * b);
    }
    this.quaternions.needsUpdate = this.positions.needsUpdate = true;
  }

  /** Aside by this much [m], to the right as the camera first stands. */
  setOffset(metres: number): void {
    this.ghost.group.position.copy(ASIDE).multiplyScalar(metres);
  }
}

const ASIDE = new THREE.Vector3(1.25, 1, 0).normalize();
