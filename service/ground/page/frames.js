// Binary frames of the gateway: 24 bytes of header, then JSON or a picture (service/ground/frames.py).

const VERSION = 1;
const HEADER_BYTES = 24;

export const KIND = Object.freeze({ FLEET: 1, DETAIL: 2, HISTORY: 3, CAMERA: 4, DEPTH: 5 });

/** Read one frame; throws on anything that is none. */
export function readFrame(buffer) {
  if (!(buffer instanceof ArrayBuffer) || buffer.byteLength < HEADER_BYTES) {
    throw new Error("a frame is too short");
  }
  const view = new DataView(buffer);
  if (view.getUint8(0) !== VERSION) {
    throw new Error("this page and the ground station are of different versions: load the page again");
  }
  return {
    kind: view.getUint8(1),
    selection: view.getUint16(2, true),
    ageMs: view.getFloat32(4, true),
    serverMs: view.getFloat64(8, true),
    nearM: view.getFloat32(16, true),
    farM: view.getFloat32(20, true),
    payload: new Uint8Array(buffer, HEADER_BYTES),
  };
}

const decoder = new TextDecoder();

/** The JSON of a frame. */
export function readJson(frame) {
  return JSON.parse(decoder.decode(frame.payload));
}
