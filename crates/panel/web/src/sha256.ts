/** SHA-256 (FIPS 180-4) of octets that come in parts: a browser has its own in secure contexts only, and for a whole at once. */

/** First 32 bits of the fractional parts of roots of primes. */
function fractions(count: number, root: number): Uint32Array {
  const words = new Uint32Array(count);
  for (let n = 2, found = 0; found < count; n++) {
    let prime = true;
    for (let d = 2; d * d <= n; d++) if (n % d === 0) prime = false;
    if (prime) words[found++] = ((n ** (1 / root)) % 1) * 2 ** 32;
  }
  return words;
}

const K = fractions(64, 3);

const turn = (x: number, n: number): number => (x >>> n) | (x << (32 - n));

export class Sha256 {
  private readonly state = fractions(8, 2);
  private readonly block = new Uint8Array(64);
  private readonly words = new Uint32Array(64);
  private filled = 0;
  private octets = 0;

  add(part: Uint8Array): void {
    this.octets += part.length;
    for (let at = 0; at < part.length; ) {
      const count = Math.min(64 - this.filled, part.length - at);
      this.block.set(part.subarray(at, at + count), this.filled);
      at += count;
      this.filled += count;
      if (this.filled === 64) this.mix();
    }
  }

  /** The sum of all; nothing is added behind it. */
  sum(): Uint8Array {
    const bits = 8 * this.octets;
    this.add(Uint8Array.of(0x80));
    while (this.filled !== 56) this.add(Uint8Array.of(0));
    const length = new DataView(new ArrayBuffer(8));
    length.setUint32(0, Math.floor(bits / 2 ** 32));
    length.setUint32(4, bits % 2 ** 32);
    this.add(new Uint8Array(length.buffer));
    const sum = new DataView(new ArrayBuffer(32));
    this.state.forEach((word, i) => sum.setUint32(4 * i, word));
    return new Uint8Array(sum.buffer);
  }

  private mix(): void {
    const { state, words: w } = this;
    const view = new DataView(this.block.buffer);
    for (let i = 0; i < 16; i++) w[i] = view.getUint32(4 * i);
    for (let i = 16; i < 64; i++) {
      const a = w[i - 15]!;
      const b = w[i - 2]!;
      w[i] = w[i - 16]! + (turn(a, 7) ^ turn(a, 18) ^ (a >>> 3)) + w[i - 7]! + (turn(b, 17) ^ turn(b, 19) ^ (b >>> 10));
    }
    let [a, b, c, d, e, f, g, h] = state as unknown as [number, number, number, number, number, number, number, number];
    for (let i = 0; i < 64; i++) {
      const one = (h + (turn(e, 6) ^ turn(e, 11) ^ turn(e, 25)) + ((e & f) ^ (~e & g)) + K[i]! + w[i]!) | 0;
      const two = ((turn(a, 2) ^ turn(a, 13) ^ turn(a, 22)) + ((a & b) ^ (a & c) ^ (b & c))) | 0;
      h = g;
      g = f;
      f = e;
      e = (d + one) | 0;
      d = c;
      c = b;
      b = a;
      a = (one + two) | 0;
    }
    [a, b, c, d, e, f, g, h].forEach((word, i) => (state[i] = state[i]! + word));
    this.filled = 0;
  }
}
