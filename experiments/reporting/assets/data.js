// The block of data in the page: as `reporting/packing.py` packs it.

/** Return what the page was given: charts by name, picks, looks, terms. */
async function unpacked() {
  const block = document.getElementById("page-data");
  if (!block || !block.textContent.trim()) return { charts: {}, picks: {}, looks: {}, terms: {} };
  const packed = Uint8Array.from(atob(block.textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const buffer = await new Response(stream).arrayBuffer();
  const length = new DataView(buffer).getUint32(0, true);
  const heap = new Uint8Array(buffer, 4 + length);
  const text = new TextDecoder().decode(new Uint8Array(buffer, 4, length));
  return JSON.parse(text, (key, value) => (isArray(value) ? numbers(value.array, heap) : value));
}

const isArray = (value) => value !== null && typeof value === "object" && Array.isArray(value.array);

/** Return an array as numbers; NaN is a gap. */
function numbers([kind, offset, length, low, step], heap) {
  if (kind === "even") return Float64Array.from({ length }, (_, i) => low + step * i);
  const size = kind === "i2" ? 2 : 4;
  const bytes = new Uint8Array(length * size);
  for (let i = 0; i < length; i++)
    for (let b = 0; b < size; b++) bytes[size * i + b] = heap[offset + b * length + i];
  const view = new DataView(bytes.buffer);
  if (kind === "f4") return Float64Array.from({ length }, (_, i) => view.getFloat32(4 * i, true));
  const found = new Float64Array(length);
  for (let i = 0, level = 0; i < length; i++) {
    level = ((level + view.getInt16(2 * i, true)) << 16) >> 16;
    found[i] = level === -32768 ? NaN : low + step * level;
  }
  return found;
}
