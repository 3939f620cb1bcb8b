// The part of Khronos' validator that the tests use; the package brings no types.
declare module 'gltf-validator' {
  export interface Report {
    issues: {
      numErrors: number;
      numWarnings: number;
      messages: { code: string; message: string; pointer?: string; severity: number }[];
    };
    info: { animationCount: number; drawCallCount: number; hasTextures: boolean; totalTriangleCount: number };
  }
  export function validateBytes(data: Uint8Array): Promise<Report>;
}
