// Pose of every body of every copy, computed on the GPU from base poses and z.
import * as THREE from 'three';
import type { Frame, Maps, SceneMessage } from '../wire/messages';
import { COORDINATE_SHADER, FULLSCREEN_VERTEX, POSE_SHADER } from './glsl';

function floatTexture(width: number, height: number): THREE.DataTexture {
  const texture = new THREE.DataTexture(
    new Float32Array(4 * width * height),
    width,
    height,
    THREE.RGBAFormat,
    THREE.FloatType,
  );
  texture.needsUpdate = true;
  return texture;
}

function pixels(texture: THREE.DataTexture): Float32Array {
  return texture.image.data as Float32Array;
}

function target(width: number, height: number, count: number): THREE.WebGLRenderTarget {
  return new THREE.WebGLRenderTarget(width, height, {
    count,
    format: THREE.RGBAFormat,
    type: THREE.FloatType,
    minFilter: THREE.NearestFilter,
    magFilter: THREE.NearestFilter,
    depthBuffer: false,
  });
}

function pass(fragmentShader: string, uniforms: Record<string, THREE.IUniform>): THREE.RawShaderMaterial {
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: FULLSCREEN_VERTEX,
    fragmentShader,
    uniforms,
    depthTest: false,
    depthWrite: false,
  });
}

/** Turns by whole circles change nothing but cost digits in single precision. */
function withoutTurns(q: number, screw: number[] | undefined): number {
  if (!screw || Math.abs(q) < Math.PI) return q;
  const [wx = 0, wy = 0, wz = 0, vx = 0, vy = 0, vz = 0] = screw;
  const unit = Math.abs(wx * wx + wy * wy + wz * wz - 1) < 1e-9;
  const pitch = Math.abs(wx * vx + wy * vy + wz * vz);
  return unit && pitch < 1e-12 ? q - 2 * Math.PI * Math.round(q / (2 * Math.PI)) : q;
}

export class PoseSolver {
  readonly bodies: number;
  private readonly roots: number;
  private readonly coordinates: number;
  private readonly joints: THREE.DataTexture;
  private readonly bodyInfo: THREE.DataTexture;
  private readonly screws: THREE.DataTexture;
  private readonly rootOf: THREE.DataTexture;
  private readonly references: THREE.DataTexture;
  private readonly rests: THREE.DataTexture;
  private readonly bases: THREE.DataTexture;
  private maps = floatTexture(1, 1);
  private reduced = floatTexture(1, 1);
  private twists = floatTexture(1, 1);
  private blocks = 0;
  private current: (Maps | null)[] = [];
  private readonly coordinateTarget: THREE.WebGLRenderTarget;
  private readonly poseTarget: THREE.WebGLRenderTarget;
  private readonly coordinatePass: THREE.RawShaderMaterial;
  private readonly posePass: THREE.RawShaderMaterial;
  private readonly quad: THREE.Mesh;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.Camera();

  constructor(
    private readonly model: SceneMessage,
    readonly copies = 1,
  ) {
    this.bodies = Math.max(1, model.bodies.length);
    this.roots = Math.max(1, model.roots.length);
    this.coordinates = Math.max(1, model.screws.length);
    this.bodyInfo = floatTexture(this.bodies, 3);
    this.joints = floatTexture(Math.max(1, model.joints.length), 1);
    this.screws = floatTexture(this.coordinates, 2);
    this.rootOf = floatTexture(this.coordinates, 1);
    this.references = floatTexture(this.bodies, 2);
    this.rests = floatTexture(this.coordinates, copies);
    this.bases = floatTexture(2, this.roots * copies);
    this.writeModel();
    this.coordinateTarget = target(this.coordinates, copies, 1);
    this.poseTarget = target(this.bodies, copies, 2);
    this.coordinatePass = pass(COORDINATE_SHADER, {
      rests: { value: this.rests },
      maps: { value: this.maps },
      reduced: { value: this.reduced },
      rootOf: { value: this.rootOf },
      roots: { value: this.roots },
      blocks: { value: 0 },
    });
    this.posePass = pass(POSE_SHADER, {
      bodies: { value: this.bodyInfo },
      joints: { value: this.joints },
      screws: { value: this.screws },
      coordinates: { value: this.coordinateTarget.texture },
      reduced: { value: this.reduced },
      twists: { value: this.twists },
      references: { value: this.references },
      bases: { value: this.bases },
      roots: { value: this.roots },
      blocks: { value: 0 },
      twistMode: { value: model.recovery === 'twist' },
    });
    const triangle = new THREE.BufferGeometry();
    triangle.setAttribute('position', new THREE.Float32BufferAttribute([-1, -1, 0, 3, -1, 0, -1, 3, 0], 3));
    this.quad = new THREE.Mesh(triangle, this.posePass);
    this.quad.frustumCulled = false;
    this.scene.add(this.quad);
  }

  /** Quaternions and positions: bodies x copies. */
  get quaternions(): THREE.Texture {
    return this.poseTarget.textures[0] as THREE.Texture;
  }
  get positions(): THREE.Texture {
    return this.poseTarget.textures[1] as THREE.Texture;
  }

  private writeModel(): void {
    const info = pixels(this.bodyInfo);
    this.model.bodies.forEach((body, b) => {
      const [x, y, z, qw, qx, qy, qz] = body.pose;
      const moves = this.model.roots[body.root]?.base !== 'free';
      info.set([body.root, body.last_joint, moves ? 1 : 0, 0], 4 * b);
      info.set([qx, qy, qz, qw], 4 * (this.bodies + b));
      info.set([x, y, z, 1], 4 * (2 * this.bodies + b));
    });
    const joints = pixels(this.joints);
    this.model.joints.forEach((joint, j) => joints.set([joint.previous, joint.offset, joint.size, 0], 4 * j));
    const screws = pixels(this.screws);
    this.model.screws.forEach((s, i) => {
      screws.set([...s.slice(0, 3), 0], 4 * i);
      screws.set([...s.slice(3, 6), 0], 4 * (this.coordinates + i));
    });
    const rootOf = pixels(this.rootOf);
    this.model.roots.forEach((root, r) => {
      for (let i = 0; i < root.coordinates; ++i) rootOf[4 * (root.first_coordinate + i)] = r;
    });
  }

  private writeMaps(maps: (Maps | null)[]): void {
    const blocks = Math.max(1, ...maps.map((m) => Math.ceil((m?.r ?? 0) / 4)));
    if (blocks !== this.blocks) {
      this.blocks = blocks;
      this.maps.dispose();
      this.reduced.dispose();
      this.twists.dispose();
      this.maps = floatTexture(blocks, this.coordinates);
      this.reduced = floatTexture(blocks, this.roots * this.copies);
      this.twists = floatTexture(8 * blocks, this.bodies);
      for (const material of [this.coordinatePass, this.posePass]) {
        (material.uniforms['reduced'] as THREE.IUniform).value = this.reduced;
        (material.uniforms['blocks'] as THREE.IUniform).value = blocks;
      }
      (this.coordinatePass.uniforms['maps'] as THREE.IUniform).value = this.maps;
      (this.posePass.uniforms['twists'] as THREE.IUniform).value = this.twists;
    }
    const Q = pixels(this.maps).fill(0);
    const T = pixels(this.twists).fill(0);
    const X = pixels(this.references);
    maps.forEach((m, i) => {
      const root = this.model.roots[i];
      if (!m || !root) return;
      for (let row = 0; row < m.n; ++row)
        Q.set(m.Q.subarray(row * m.r, (row + 1) * m.r), 4 * blocks * (root.first_coordinate + row));
      if (!m.twist) return;
      for (let b = 0; b < m.bodies; ++b) {
        const [x, y, z, qw, qx, qy, qz] = m.twist.poses.subarray(7 * b, 7 * b + 7);
        X.set([qx ?? 0, qy ?? 0, qz ?? 0, qw ?? 1], 4 * (root.first_body + b));
        X.set([x ?? 0, y ?? 0, z ?? 0, 1], 4 * (this.bodies + root.first_body + b));
        for (let k = 0; k < m.r; ++k) {
          const from = (b * m.r + k) * 6;
          const to = 4 * (8 * blocks * (root.first_body + b) + 2 * k);
          T.set(m.twist.T.subarray(from, from + 3), to);
          T.set(m.twist.T.subarray(from + 3, from + 6), to + 4);
        }
      }
    });
    for (const texture of [this.maps, this.twists, this.references]) texture.needsUpdate = true;
    this.current = maps;
  }

  /** Puts a frame in the place of one copy. Copies that share maps may be set one after the other. */
  set(frame: Frame, maps: (Maps | null)[], copy = 0): void {
    if (maps.length !== this.current.length || maps.some((m, i) => m !== this.current[i])) this.writeMaps(maps);
    const rests = pixels(this.rests);
    const z = pixels(this.reduced);
    const bases = pixels(this.bases);
    frame.roots.forEach((state, i) => {
      const root = this.model.roots[i];
      if (!root) return;
      const row = copy * this.roots + i;
      z.fill(0, 4 * this.blocks * row, 4 * this.blocks * (row + 1));
      z.set(state.z, 4 * this.blocks * row);
      const [x, y, zz, qw, qx, qy, qz] = state.pose;
      bases.set([qx ?? 0, qy ?? 0, qz ?? 0, qw ?? 1, x ?? 0, y ?? 0, zz ?? 0, 1], 8 * row);
      const m = maps[i];
      if (!m) return;
      for (let k = 0; k < m.n; ++k) {
        const coordinate = root.first_coordinate + k;
        rests[4 * (copy * this.coordinates + coordinate)] =
          withoutTurns(m.q_ref[k] ?? 0, this.model.screws[coordinate]) + (state.correction[k] ?? 0);
      }
    });
    for (const texture of [this.rests, this.reduced, this.bases]) texture.needsUpdate = true;
  }

  /** Runs both passes. */
  solve(renderer: THREE.WebGLRenderer): void {
    const before = renderer.getRenderTarget();
    this.quad.material = this.coordinatePass;
    renderer.setRenderTarget(this.coordinateTarget);
    renderer.render(this.scene, this.camera);
    this.quad.material = this.posePass;
    renderer.setRenderTarget(this.poseTarget);
    renderer.render(this.scene, this.camera);
    renderer.setRenderTarget(before);
  }

  /** Reads poses back: bodies x 7 (x y z qw qx qy qz) of one copy. Slow; for tests. */
  read(renderer: THREE.WebGLRenderer, copy = 0): Float32Array {
    const q = new Float32Array(4 * this.bodies);
    const p = new Float32Array(4 * this.bodies);
    renderer.readRenderTargetPixels(this.poseTarget, 0, copy, this.bodies, 1, q, undefined, 0);
    renderer.readRenderTargetPixels(this.poseTarget, 0, copy, this.bodies, 1, p, undefined, 1);
    const out = new Float32Array(7 * this.bodies);
    for (let b = 0; b < this.bodies; ++b) {
      out.set(p.subarray(4 * b, 4 * b + 3), 7 * b);
      out.set([q[4 * b + 3] ?? 1, q[4 * b] ?? 0, q[4 * b + 1] ?? 0, q[4 * b + 2] ?? 0], 7 * b + 3);
    }
    return out;
  }

  dispose(): void {
    for (const t of [this.joints, this.bodyInfo, this.screws, this.rootOf, this.references, this.rests, this.bases])
      t.dispose();
    for (const t of [this.maps, this.reduced, this.twists]) t.dispose();
    this.coordinateTarget.dispose();
    this.poseTarget.dispose();
    this.coordinatePass.dispose();
    this.posePass.dispose();
    this.quad.geometry.dispose();
  }
}
