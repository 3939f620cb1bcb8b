// The messages of the stream, as docs/wire.md describes them.

/** x y z qw qx qy qz */
export type PoseNumbers = [number, number, number, number, number, number, number];

export interface RootInfo {
  name: string;
  base: 'fixed' | 'floating' | 'driven' | 'free';
  first_body: number;
  bodies: number;
  first_coordinate: number;
  coordinates: number;
  mass: number;
  closures?: number;
  reduced?: { free: number; elastic: number; modes: number };
}

export interface BodyInfo {
  name: string;
  root: number;
  parent: number;
  last_joint: number;
  interface: boolean;
  mass: number;
  center: [number, number, number]; // of mass, in the body
  inertia: number[]; // xx yy zz xy xz yz about the centre, in the body's axes
  pose: PoseNumbers;
}

export interface JointInfo {
  name: string;
  kind: 'hinge' | 'slide' | 'ball' | 'cylindrical' | 'planar' | 'free' | 'general';
  body: number;
  previous: number;
  offset: number;
  size: number;
}

export interface ControlInfo {
  name: string;
  range: [number, number];
  base: boolean;
  joints: number[]; // that it moves
}

/** What a thread passes; obstacles stand between two points, after a pulley a further branch begins. */
export interface TendonInfo {
  name: string;
  root: number;
  elements: {
    kind: 'point' | 'sphere' | 'cylinder' | 'pulley';
    body?: number;
    pose?: PoseNumbers; // in the body
    radius?: number;
    side?: { body: number; at: [number, number, number] };
  }[];
}

/** Of the stream that this page understands: kWireVersion of the program. */
export const WIRE_VERSION = 7;

export interface SceneMessage {
  type: 'scene';
  version: number;
  epoch: number;
  geometry: number; // version of the shapes that belong to it
  title: string;
  recovery: 'exact' | 'twist';
  radius: number;
  scalars: string[];
  roots: RootInfo[];
  bodies: BodyInfo[];
  joints: JointInfo[];
  screws: number[][];
  tendons: TendonInfo[];
  controls: ControlInfo[];
  groups: { name: string; mechanism: number }[];
  signals: { name: string; group: string; unit: string; body: number }[]; // of a frame's signals
  warnings: string[];
}

export interface SettingsMessage {
  type: 'settings';
  dt: number;
  gravity: number;
  damping: number;
  friction: number;
  modes: number;
  detail: number;
  recovery: number;
  pull_stiffness: number;
  speed: number;
  ghost: boolean;
  signals: boolean;
  error: boolean;
  accuracy: number; // m, 0: none is asked for
  stiffness: number[];
  controls: number[];
}

export type ShapeKind = 'plane' | 'sphere' | 'capsule' | 'cylinder' | 'ellipsoid' | 'box' | 'mesh' | 'heightfield';

export interface ShapeInfo {
  body: number;
  name: string;
  kind: ShapeKind;
  pose: PoseNumbers;
  rgba: [number, number, number, number];
  group: number;
  collides: boolean;
  size?: number[];
  mesh?: number;
  picture?: number; // on a mesh that says where, or on a plane
  repeat?: number[]; // pictures a metre along x and y of a plane, one in its middle
}

export interface GeometryMessage {
  type: 'geometry';
  version: number;
  shapes: ShapeInfo[];
  meshes: number;
}

export interface NoticeMessage {
  type: 'notice';
  message: string;
}

export interface ProblemMessage {
  type: 'problem';
  about: 'file' | 'request' | 'run' | 'ghost';
  message: string; // empty: no longer so
}

/** A number of the model that can be changed. */
export interface TunableInfo {
  of: 'joint' | 'actuator' | 'body' | 'world';
  owner: string;
  quantity: string;
  unit: string;
  value: number | null; // null: no bound
  original: number | null; // of the file
}

export interface TuningMessage {
  type: 'tuning';
  items: TunableInfo[];
  writes: boolean; // a copy of the file can be made
}

/** What was kept, to the viewer who asked. */
export interface WrittenMessage {
  type: 'written';
  path: string; // of the copy; empty: none was asked for
  text: string; // of the moment
  notes: string[]; // what found no place in it
}

/** What a request `shape` led to: compliances [m/N], xx yy zz xy xz yz in the axes of the body's root. */
export interface ShapedMessage {
  type: 'shaped';
  body: number;
  asked: number[];
  reached: number[];
  stiffest: number[]; // with every stiffness at its bound
  softest: number[];
  stiffnesses: number; // of its mechanism
  at_bound: number; // of those
}

/** Bodies that passed through others because they are no interface. */
export interface AdviceMessage {
  type: 'advice';
  epoch: number;
  items: { body: number; name: string; other: string; depth: number; time: number }[];
}

export type TextMessage =
  | SceneMessage
  | SettingsMessage
  | GeometryMessage
  | NoticeMessage
  | ProblemMessage
  | TuningMessage
  | WrittenMessage
  | ShapedMessage
  | AdviceMessage;

export interface MeshData {
  positions: Float32Array;
  triangles: Uint32Array;
  uv: Float32Array; // place in a picture, of the corners of its triangles, rows from the top; or none
}

/** What there is to draw. */
export interface Shapes {
  geometry: GeometryMessage;
  meshes: MeshData[];
  pictures: Uint8Array[]; // PNG files
}

export interface Maps {
  epoch: number;
  root: number;
  version: number;
  n: number;
  r: number;
  bodies: number;
  q_ref: Float64Array;
  Q: Float32Array; // n x r, row by row
  /** of interface bodies: xx yy zz xy xz yz [m/N] in the root's axes; `body` counts within the root */
  compliance: { body: number; C: number[] }[];
  twist?: { poses: Float64Array; T: Float32Array }; // bodies x 7, bodies x r x 6
}

export interface RootState {
  version: number;
  pose: Float64Array; // 7
  z: Float32Array;
  correction: Float32Array; // empty or one per coordinate
}

export interface Contact {
  a: number;
  b: number;
  point: [number, number, number];
  normal: [number, number, number];
  force: [number, number, number];
  gap: number;
  friction: number;
}

export interface Pull {
  body: number;
  point: [number, number, number];
  target: [number, number, number];
  force: [number, number, number];
}

export interface Frame {
  epoch: number;
  sequence: number;
  paused: boolean;
  scalars: Float64Array;
  roots: RootState[];
  contacts: Contact[];
  pulls: Pull[];
  signals: Float32Array; // as the scene lists them, or none
}

/** Where the full simulation has got to. */
export interface GhostFrame {
  epoch: number;
  time: number; // s
  behind: number; // s after the reduced one
  distance: number; // m between the origins of the worst body at `time`
  body: number; // which one, -1: none moves
  poses: Float32Array; // bodies x 7
}

export type BinaryMessage =
  | { kind: 'ghost'; ghost: GhostFrame }
  | { kind: 'maps'; maps: Maps }
  | { kind: 'frame'; frame: Frame }
  | { kind: 'meshes'; meshes: MeshData[]; pictures: Uint8Array[] };
