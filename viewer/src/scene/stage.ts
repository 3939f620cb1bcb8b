// Renderer, camera, light and ground.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { squareSide, type Area } from '../ui/free_area';
import { PlanesView } from './planes_view';
import { LIGHT, type Theme } from './theme';

const GRID_FRAGMENT = /* glsl */ `
uniform vec3 line;
uniform float spacing;
uniform float reach;
uniform vec2 centre;
in vec2 place;
float lines(vec2 at, float width) {
  vec2 d = abs(fract(at - 0.5) - 0.5) / fwidth(at);
  return 1.0 - min(min(d.x, d.y) / width, 1.0);
}
void main() {
  float fine = 0.22 * lines(place / spacing, 1.0);
  float coarse = 0.5 * lines(place / (5.0 * spacing), 1.3);
  float fade = 1.0 - smoothstep(0.25, 1.0, length(place - centre) / reach);
  gl_FragColor = vec4(line, max(fine, coarse) * fade);
}`;

/** 1, 2 or 5 times a power of ten, at most x. */
export function roundDown(x: number): number {
  const power = 10 ** Math.floor(Math.log10(x));
  return power * (x >= 5 * power ? 5 : x >= 2 * power ? 2 : 1);
}

export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  readonly scene = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(32, 1, 0.01, 100);
  readonly controls: OrbitControls;
  /** planes of the file with pictures; the grid is drawn where they leave the ground bare */
  readonly planes = new PlanesView();
  gridSpacing = 0.1;
  private readonly sky = new THREE.HemisphereLight(0xffffff, 0xffffff, 1.25);
  private readonly key = new THREE.DirectionalLight(0xfff4e6, 2.3);
  private readonly fill = new THREE.DirectionalLight(0xdfe9ff, 0.55);
  private readonly shadowMaterial = new THREE.ShadowMaterial({ opacity: 0.25 });
  private readonly gridMaterial: THREE.ShaderMaterial;
  private readonly floor: THREE.Mesh;
  private readonly grid: THREE.Mesh;
  private radius = 1;
  private ground = 0;
  private home = { position: new THREE.Vector3(), target: new THREE.Vector3() };

  constructor(canvas: HTMLCanvasElement) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    if (!this.renderer.getContext().getExtension('EXT_color_buffer_float'))
      throw new Error('This browser cannot draw into float textures (EXT_color_buffer_float); take another one.');
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.0;
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.15;
    this.key.castShadow = true;
    this.key.shadow.mapSize.set(2048, 2048);
    this.key.shadow.radius = 5;
    this.key.shadow.bias = -0.0004;
    this.scene.add(this.sky, this.key, this.key.target, this.fill);
    this.gridMaterial = new THREE.ShaderMaterial({
      transparent: true,
      depthWrite: false,
      uniforms: {
        line: { value: new THREE.Color() },
        spacing: { value: 0.1 },
        reach: { value: 1 },
        centre: { value: new THREE.Vector2() },
      },
      vertexShader: /* glsl */ `
        out vec2 place;
        void main() {
          vec4 world = modelMatrix * vec4(position, 1.0);
          place = world.xy;
          gl_Position = projectionMatrix * viewMatrix * world;
        }`,
      fragmentShader: GRID_FRAGMENT,
    });
    const plane = new THREE.PlaneGeometry(1, 1);
    this.floor = new THREE.Mesh(plane, this.shadowMaterial);
    this.floor.receiveShadow = true;
    this.grid = new THREE.Mesh(plane, this.gridMaterial);
    this.grid.renderOrder = -2;
    this.scene.add(this.grid, this.planes.group, this.floor);
    this.setTheme(LIGHT);
  }

  setTheme(theme: Theme): void {
    this.scene.background = new THREE.Color(theme.background);
    this.scene.fog = null;
    (this.gridMaterial.uniforms['line'] as THREE.IUniform<THREE.Color>).value.set(theme.line);
    this.shadowMaterial.opacity = theme.shadow;
    this.planes.setDark(theme.dark);
    this.sky.color.set(theme.sky);
    this.sky.groundColor.set(theme.soil);
    this.sky.intensity = theme.dark ? 0.9 : 1.25;
    this.key.intensity = theme.dark ? 2.2 : 2.3;
    this.fill.intensity = theme.dark ? 1.4 : 0.55; // dark bodies need an edge against a dark page
  }

  setShadows(on: boolean): void {
    this.key.castShadow = on;
  }

  /** Puts camera, light and ground around a box; `ground` is the height of the floor. `stay`: not the camera. */
  frame(box: THREE.Box3, ground: number, stay = false): void {
    const centre = box.getCenter(new THREE.Vector3());
    this.radius = Math.max(1e-3, 0.5 * box.getSize(new THREE.Vector3()).length());
    const distance = (this.radius * 1.12) / Math.sin(THREE.MathUtils.degToRad(0.5 * this.camera.fov));
    this.home.target.copy(centre);
    this.home.position.copy(centre).addScaledVector(new THREE.Vector3(1, -1.25, 0.72).normalize(), distance);
    this.camera.near = distance / 200;
    this.camera.far = distance * 40;
    this.controls.minDistance = this.radius * 0.15;
    this.controls.maxDistance = distance * 8;
    this.gridSpacing = roundDown(this.radius / 2);
    const reach = 9 * this.radius;
    const uniforms = this.gridMaterial.uniforms as Record<string, THREE.IUniform>;
    (uniforms['spacing'] as THREE.IUniform).value = this.gridSpacing;
    (uniforms['reach'] as THREE.IUniform).value = reach;
    for (const mesh of [this.floor, this.grid]) {
      mesh.scale.setScalar(2 * reach);
      mesh.position.set(centre.x, centre.y, ground);
    }
    this.grid.position.z = ground - 1e-4 * this.radius;
    this.ground = ground;
    const camera = this.key.shadow.camera;
    const s = 2.2 * this.radius;
    camera.left = camera.bottom = -s;
    camera.right = camera.top = s;
    camera.near = 0.1 * this.radius;
    camera.far = 14 * this.radius;
    camera.updateProjectionMatrix();
    this.key.shadow.normalBias = 0.004 * this.radius;
    if (!stay) this.goHome();
    this.lightAround(centre);
  }

  goHome(): void {
    this.camera.position.copy(this.home.position);
    this.controls.target.copy(this.home.target);
    this.camera.updateProjectionMatrix();
    this.controls.update();
  }

  /** Turns the camera about the framed box, in degrees; `at` becomes the middle of the picture. */
  lookFrom(azimuth?: number, elevation?: number, zoom = 1, at?: readonly [number, number, number]): void {
    const arm = this.camera.position.clone().sub(this.controls.target);
    const a = azimuth === undefined ? Math.atan2(arm.y, arm.x) : THREE.MathUtils.degToRad(azimuth);
    const e = elevation === undefined ? Math.asin(arm.z / arm.length()) : THREE.MathUtils.degToRad(elevation);
    const distance = arm.length() / zoom;
    arm.set(Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)).multiplyScalar(distance);
    if (at) this.controls.target.set(...at);
    this.controls.minDistance = Math.min(this.controls.minDistance, distance);
    this.camera.position.copy(this.controls.target).add(arm);
    this.controls.update();
  }

  private lightAround(centre: THREE.Vector3): void {
    this.key.target.position.copy(centre);
    this.key.position.copy(centre).addScaledVector(new THREE.Vector3(0.45, -0.5, 1).normalize(), 7 * this.radius);
    this.fill.position.copy(centre).addScaledVector(new THREE.Vector3(-1, 0.6, 0.35).normalize(), 5 * this.radius);
    (this.gridMaterial.uniforms['centre'] as THREE.IUniform<THREE.Vector2>).value.set(centre.x, centre.y);
    this.planes.place(centre, 9 * this.radius);
  }

  /** Whether the page's own grid is drawn: not where a picture of the file covers the ground. */
  get gridShown(): boolean {
    return !this.planes.covers(this.ground);
  }

  /** Moves camera, light and ground along with a point that moved by `shift`. */
  follow(shift: THREE.Vector3): void {
    const level = shift.clone().setZ(0);
    this.camera.position.add(shift);
    this.controls.target.add(shift);
    this.floor.position.add(level);
    this.grid.position.add(level);
    this.lightAround(this.controls.target);
  }

  resize(width: number, height: number): void {
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
  }

  /** The camera's field of view is the largest square in the middle of this area of the canvas [pixels]; the canvas shows what lies around it, too. */
  frameIn(area: Area): void {
    const { width, height } = this.renderer.getSize(new THREE.Vector2());
    const side = Math.max(1, squareSide(area));
    this.camera.setViewOffset(side, side, (side - area.left - area.right) / 2, (side - area.top - area.bottom) / 2, width, height);
    this.controls.panSpeed = height / side; // the controls take the canvas's height for the field of view's
  }

  render(): void {
    this.controls.update();
    this.grid.visible = this.gridShown;
    this.renderer.render(this.scene, this.camera);
  }
}
