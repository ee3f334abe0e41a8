// CRC-64/XZ, as the core has it.

const TABLE = Array.from({ length: 256 }, (_, byte) => {
  let value = BigInt(byte);
  for (let bit = 0; bit < 8; bit++) value = value & 1n ? (value >> 1n) ^ 0xc96c5795d7870f42n : value >> 1n;
  return [Number(value >> 32n), Number(value & 0xffffffffn)];
});

export function digest(array) {
  const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
  let [high, low] = [0xffffffff, 0xffffffff];
  for (const byte of bytes) {
    const [th, tl] = TABLE[(low ^ byte) & 0xff];
    low = (((low >>> 8) | (high << 24)) ^ tl) >>> 0;
    high = ((high >>> 8) ^ th) >>> 0;
  }
  return [~high, ~low].map((half) => (half >>> 0).toString(16).padStart(8, "0")).join("");
}
