// Arrays as cases/viewer/pack.py packs them.

const KINDS = { uint8: Uint8Array, uint32: Uint32Array, float32: Float32Array };

async function inflate(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i += 1) bytes[i] = letters.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The bytes of each number, which stand in planes: all first bytes, then all second ones and so on.
function gather(planes, size) {
  const count = planes.length / size;
  const bytes = new Uint8Array(planes.length);
  for (let plane = 0; plane < size; plane += 1) {
    for (let i = 0, at = plane; i < count; i += 1, at += size) bytes[at] = planes[plane * count + i];
  }
  return bytes;
}

// A typed array; floats are divided by `packed.factor`.
export async function unpack(packed) {
  const Kind = KINDS[packed.type];
  const numbers = new Kind(gather(await inflate(packed.data), Kind.BYTES_PER_ELEMENT).buffer);
  if (packed.differences) {
    const width = packed.shape[1];
    for (let i = width; i < numbers.length; i += 1) numbers[i] += numbers[i - width];
  }
  return numbers;
}

// Positions in the unit of the case.
export async function unpackPoints(packed) {
  const numbers = await unpack(packed);
  for (let i = 0; i < numbers.length; i += 1) numbers[i] *= packed.factor;
  return numbers;
}
