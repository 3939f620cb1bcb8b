// Pose of every body of every copy, computed on the GPU from base poses and z.
import * as THREE from 'three';
import type { Frame, Maps, SceneMessage } from '../wire/messages';
import { COORDINATE_SHADER, FULLSCREEN_VERTEX, POSE_SHADER } from './glsl';
import { listSize, listTexture, numbers } from './lists';

/** Where the poses of all bodies of all copies stand: copy, body. */
export interface PoseLists {
  readonly quaternions: THREE.Texture;
  readonly positions: THREE.Texture;
  readonly bodies: number; // of one copy
  readonly copies: number;
}

function target(entries: number, count: number): THREE.WebGLRenderTarget {
  const [width, height] = listSize(entries);
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

export class PoseSolver implements PoseLists {
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
  private maps = listTexture(1);
  private reduced = listTexture(1);
  private twists = listTexture(1);
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
    this.bodyInfo = listTexture(3 * this.bodies);
    this.joints = listTexture(model.joints.length);
    this.screws = listTexture(2 * this.coordinates);
    this.rootOf = listTexture(this.coordinates);
    this.references = listTexture(2 * this.bodies);
    this.rests = listTexture(this.coordinates * copies);
    this.bases = listTexture(2 * this.roots * copies);
    this.writeModel();
    this.coordinateTarget = target(this.coordinates * copies, 1);
    this.poseTarget = target(this.bodies * copies, 2);
    const list = (each: number): Record<string, THREE.IUniform> => ({
      roots: { value: this.roots },
      blocks: { value: 0 },
      each: { value: each },
      count: { value: each * copies },
      width: { value: listSize(each * copies)[0] },
    });
    this.coordinatePass = pass(COORDINATE_SHADER, {
      ...list(this.coordinates),
      rests: { value: this.rests },
      maps: { value: this.maps },
      reduced: { value: this.reduced },
      rootOf: { value: this.rootOf },
    });
    this.posePass = pass(POSE_SHADER, {
      ...list(this.bodies),
      bodies: { value: this.bodyInfo },
      joints: { value: this.joints },
      screws: { value: this.screws },
      coordinates: { value: this.coordinateTarget.texture },
      reduced: { value: this.reduced },
      twists: { value: this.twists },
      references: { value: this.references },
      bases: { value: this.bases },
      coordinatesEach: { value: this.coordinates },
      twistMode: { value: model.recovery === 'twist' },
    });
    const triangle = new THREE.BufferGeometry();
    triangle.setAttribute('position', new THREE.Float32BufferAttribute([-1, -1, 0, 3, -1, 0, -1, 3, 0], 3));
    this.quad = new THREE.Mesh(triangle, this.posePass);
    this.quad.frustumCulled = false;
    this.scene.add(this.quad);
  }

  get quaternions(): THREE.Texture {
    return this.poseTarget.textures[0] as THREE.Texture;
  }
  get positions(): THREE.Texture {
    return this.poseTarget.textures[1] as THREE.Texture;
  }

  private writeModel(): void {
    const info = numbers(this.bodyInfo);
    this.model.bodies.forEach((body, b) => {
      const [x, y, z, qw, qx, qy, qz] = body.pose;
      const moves = this.model.roots[body.root]?.base !== 'free';
      info.set([body.root, body.last_joint, moves ? 1 : 0, 0, qx, qy, qz, qw, x, y, z, 1], 12 * b);
    });
    const joints = numbers(this.joints);
    this.model.joints.forEach((joint, j) => joints.set([joint.previous, joint.offset, joint.size, 0], 4 * j));
    const screws = numbers(this.screws);
    this.model.screws.forEach((s, i) => screws.set([...s.slice(0, 3), 0, ...s.slice(3, 6), 0], 8 * i));
    const rootOf = numbers(this.rootOf);
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
      this.maps = listTexture(blocks * this.coordinates);
      this.reduced = listTexture(blocks * this.roots * this.copies);
      this.twists = listTexture(this.model.recovery === 'twist' ? 8 * blocks * this.bodies : 1);
      this.current = [];
      for (const material of [this.coordinatePass, this.posePass]) {
        (material.uniforms['reduced'] as THREE.IUniform).value = this.reduced;
        (material.uniforms['blocks'] as THREE.IUniform).value = blocks;
      }
      (this.coordinatePass.uniforms['maps'] as THREE.IUniform).value = this.maps;
      (this.posePass.uniforms['twists'] as THREE.IUniform).value = this.twists;
    }
    const Q = numbers(this.maps);
    const T = numbers(this.twists);
    const X = numbers(this.references);
    maps.forEach((m, i) => {
      const root = this.model.roots[i];
      if (!m || !root || m === this.current[i]) return;
      for (let row = 0; row < m.n; ++row) {
        const at = 4 * blocks * (root.first_coordinate + row);
        Q.fill(0, at, at + 4 * blocks); // the root may have had more directions before
        Q.set(m.Q.subarray(row * m.r, (row + 1) * m.r), at);
      }
      if (!m.twist) return;
      for (let b = 0; b < m.bodies; ++b) {
        const [x, y, z, qw, qx, qy, qz] = m.twist.poses.subarray(7 * b, 7 * b + 7);
        X.set([qx ?? 0, qy ?? 0, qz ?? 0, qw ?? 1, x ?? 0, y ?? 0, z ?? 0, 1], 8 * (root.first_body + b));
        T.fill(0, 32 * blocks * (root.first_body + b), 32 * blocks * (root.first_body + b + 1));
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
    if (maps !== this.current && (maps.length !== this.current.length || maps.some((m, i) => m !== this.current[i])))
      this.writeMaps(maps);
    const rests = numbers(this.rests);
    const z = numbers(this.reduced);
    const bases = numbers(this.bases);
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
    const { width, height } = this.poseTarget;
    const read = (texture: number): Float32Array => {
      const all = new Float32Array(4 * width * height);
      renderer.readRenderTargetPixels(this.poseTarget, 0, 0, width, height, all, undefined, texture);
      return all.subarray(4 * copy * this.bodies);
    };
    const q = read(0);
    const p = read(1);
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
