// Which body lies under the pointer, by drawing a single pixel.
import * as THREE from 'three';

export interface Hit {
  body: number;
  /** in the body's frame */
  point: THREE.Vector3;
}

export class Picker {
  private readonly target = new THREE.WebGLRenderTarget(1, 1, { format: THREE.RGBAFormat, type: THREE.FloatType });
  private readonly scene = new THREE.Scene();
  private readonly pixel = new Float32Array(4);

  use(geometries: THREE.BufferGeometry[], material: THREE.ShaderMaterial): void {
    this.scene.clear();
    for (const geometry of geometries) {
      const mesh = new THREE.Mesh(geometry, material);
      mesh.frustumCulled = false;
      this.scene.add(mesh);
    }
  }

  /** x, y in pixels of the canvas; the camera shows it by a view offset. */
  pick(renderer: THREE.WebGLRenderer, camera: THREE.PerspectiveCamera, x: number, y: number): Hit | null {
    const before = renderer.getRenderTarget();
    const clear = renderer.getClearColor(new THREE.Color());
    const alpha = renderer.getClearAlpha();
    const whole = { fullWidth: 1, fullHeight: 1, offsetX: 0, offsetY: 0, width: 1, height: 1, ...camera.view };
    camera.setViewOffset(whole.fullWidth, whole.fullHeight, whole.offsetX + x, whole.offsetY + y, 1, 1);
    renderer.setRenderTarget(this.target);
    renderer.setClearColor(0x000000, 0);
    renderer.clear();
    renderer.render(this.scene, camera);
    renderer.setRenderTarget(before);
    renderer.setClearColor(clear, alpha);
    camera.setViewOffset(whole.fullWidth, whole.fullHeight, whole.offsetX, whole.offsetY, whole.width, whole.height);
    renderer.readRenderTargetPixels(this.target, 0, 0, 1, 1, this.pixel);
    const [px = 0, py = 0, pz = 0, id = 0] = this.pixel;
    return id > 0.5 ? { body: Math.round(id) - 1, point: new THREE.Vector3(px, py, pz) } : null;
  }
}
