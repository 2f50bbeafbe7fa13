// The coarse flow field: reading its bytes (see dfvs_core/perception/flow_grid.py) and drawing it.

const HEADER_BYTES = 24;
const STEPS_PER_PX = 16;
const CONFIDENT = "#3cff6e";
const DOUBTFUL = "#ffb52e";

/** @returns {{columns, rows, stride, flow: Int16Array, confidence: Uint8Array} | null} */
export function decodeFlow(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.byteLength < HEADER_BYTES || view.getUint32(0, false) !== 0x4446564f) return null;
  const columns = view.getUint16(6, true);
  const rows = view.getUint16(8, true);
  const points = columns * rows;
  if (bytes.byteLength !== HEADER_BYTES + 5 * points) return null;
  const flow = new Int16Array(2 * points);
  for (let i = 0; i < 2 * points; i++) flow[i] = view.getInt16(HEADER_BYTES + 2 * i, true);
  const confidence = bytes.slice(HEADER_BYTES + 4 * points);
  return { columns, rows, stride: view.getUint16(10, true), flow, confidence };
}

/** Arrows from what is seen to where the goal has it; every second point, trusted ones only. */
export function drawFlow(context, grid, place) {
  const least = place.minConfidence * 255;
  const sure = (least + 255) / 2;
  const groups = { [CONFIDENT]: new Path2D(), [DOUBTFUL]: new Path2D() };
  const head = Math.max(3, 0.2 * grid.stride * place.scale);
  for (let row = 1; row < grid.rows; row += 2) {
    for (let column = 1; column < grid.columns; column += 2) {
      const i = row * grid.columns + column;
      if (grid.confidence[i] < least) continue;
      const path = groups[grid.confidence[i] > sure ? CONFIDENT : DOUBTFUL];
      addArrow(path, arrowAt(grid, column, row, i, place), head);
    }
  }
  context.lineCap = "round";
  for (const [colour, path] of Object.entries(groups)) {
    for (const [style, width] of [["rgba(0, 0, 0, .7)", 2.6], [colour, 1.2]]) {
      context.strokeStyle = style;
      context.lineWidth = width * Math.max(place.scale / 1.5, 1);
      context.stroke(path);
    }
  }
}

function arrowAt(grid, column, row, i, place) {
  const u = Math.floor(grid.stride / 2) + column * grid.stride + 0.5;
  const v = Math.floor(grid.stride / 2) + row * grid.stride + 0.5;
  const k = place.scale / STEPS_PER_PX;
  return { x: u * place.scale, y: v * place.scale, dx: grid.flow[2 * i] * k, dy: grid.flow[2 * i + 1] * k };
}

function addArrow(path, { x, y, dx, dy }, head) {
  const length = Math.hypot(dx, dy);
  path.moveTo(x, y);
  path.lineTo(x + dx + 0.01, y + dy);
  if (length < head) return;
  const [ux, uy] = [(dx / length) * head, (dy / length) * head];
  path.moveTo(x + dx - ux - 0.5 * uy, y + dy - uy + 0.5 * ux);
  path.lineTo(x + dx, y + dy);
  path.lineTo(x + dx - ux + 0.5 * uy, y + dy - uy - 0.5 * ux);
}

/** Confidence as a tint: from orange (barely trusted) to blue (sure); what is not trusted is dark. */
export function drawConfidence(context, grid, place) {
  const tint = new OffscreenCanvas(grid.columns, grid.rows);
  const tintContext = tint.getContext("2d");
  const pixels = tintContext.createImageData(grid.columns, grid.rows);
  grid.confidence.forEach((value, i) => {
    const share = value / 255;
    pixels.data.set(
      share < place.minConfidence ? [20, 0, 0, 170] : [255 * (1 - share), 150, 40 + 215 * share, 105],
      4 * i,
    );
  });
  tintContext.putImageData(pixels, 0, 0);
  const size = grid.stride * place.scale;
  context.drawImage(tint, 0, 0, grid.columns * size, grid.rows * size);
}
