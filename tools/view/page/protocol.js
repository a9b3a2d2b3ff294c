// The binary messages of docs/viewer-protocol.md. Nothing is copied: arrays lie over the message.
const kFrame = 0x31564252, kMesh = 0x314d4252;
export const kTickFloats = 17;

export function decode(buffer) {
  const view = new DataView(buffer);
  const magic = view.getUint32(0, true);
  if (magic === kFrame) return decodeFrame(buffer, view);
  if (magic === kMesh) return decodeMesh(buffer, view);
  throw new Error('a message that is no frame and no mesh');
}

function decodeFrame(buffer, view) {
  if (view.getUint16(4, true) !== 1) throw new Error('another version of the protocol: reload the page');
  const f64 = (at) => view.getFloat64(at, true), u32 = (at) => view.getUint32(at, true);
  const frame = {
    kind: 'frame', number: Number(view.getBigUint64(8, true)), now: f64(16), posesAt: f64(24), simulated: f64(32),
    scene: u32(40), jumps: u32(60), bytes: buffer.byteLength, hands: [], contacts: [],
  };
  const bodies = u32(44), nodes = u32(48), hands = u32(52), contacts = u32(56);
  let at = view.getUint16(6, true);
  const floats = (count) => { const out = new Float32Array(buffer, at, count); at += 4 * count; return out; };
  frame.poses = bodies > 0 ? floats(7 * bodies) : null;
  frame.nodes = nodes > 0 ? new Int32Array(buffer, at, 3 * nodes) : null;
  at += 12 * nodes;
  for (let i = 0; i < contacts; ++i) {
    const row = floats(8);
    frame.contacts.push({ point: row.subarray(0, 3), normal: row.subarray(3, 6), gap: row[6], hand: u32(at - 4) });
  }
  for (let i = 0; i < hands; ++i) {
    const row = floats(13);
    const hand = { proxy: row.subarray(0, 3), device: row.subarray(3, 6), force: row.subarray(6, 9),
      origin: row.subarray(9, 12), radius: row[12], count: u32(at), first: Number(view.getBigUint64(at + 4, true)) };
    at += 12;
    frame.hands.push(hand);
  }
  for (const hand of frame.hands) hand.ticks = floats(kTickFloats * hand.count);
  return frame;
}

function decodeMesh(buffer, view) {
  const [scene, index, vertices, triangles] = [4, 8, 12, 16].map((at) => view.getUint32(at, true));
  return { kind: 'mesh', scene, index, vertices: new Float32Array(buffer, 20, 3 * vertices),
    triangles: new Uint32Array(buffer, 20 + 12 * vertices, 3 * triangles) };
}
