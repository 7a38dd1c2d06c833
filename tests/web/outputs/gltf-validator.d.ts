// What is used here of the Khronos validator, which brings no types.
declare module 'gltf-validator' {
  interface Message {
    code: string;
    message: string;
    /** 0: error, 1: warning, 2: information, 3: hint. */
    severity: number;
    pointer?: string;
  }
  interface Report {
    issues: { numErrors: number; numWarnings: number; messages: Message[] };
  }
  export function validateBytes(bytes: Uint8Array, options?: { maxIssues?: number }): Promise<Report>;
}
