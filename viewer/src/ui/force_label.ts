// The force of a pull, beside the pointer.
import * as THREE from 'three';
import type { Frame } from '../wire/messages';
import { element, withUnit } from './dom';

export class ForceLabel {
  private readonly label: HTMLElement;

  constructor(private readonly parent: HTMLElement) {
    this.label = element('div', 'force', parent);
    this.label.hidden = true;
  }

  place(frame: Frame | null, camera: THREE.Camera): void {
    const pull = frame?.pulls[0];
    this.label.hidden = !pull;
    if (!pull) return;
    const at = new THREE.Vector3(...pull.target).project(camera);
    this.label.style.left = `${(0.5 + 0.5 * at.x) * this.parent.clientWidth}px`;
    this.label.style.top = `${(0.5 - 0.5 * at.y) * this.parent.clientHeight}px`;
    this.label.textContent = withUnit(Math.hypot(...pull.force), 'N');
  }
}
