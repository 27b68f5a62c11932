// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The object flattened: the photo, pulled back through the warp that verification found. The warp is a mesh of
// `columns` x `rows` points, regular in the reference image, each with its place in the photo. Each cell is two
// triangles, and each triangle one affine map.

// The affine map (a, b, c, d, e, f of a canvas transform) from triangle `from` to `to`; null if `from` has no area.
export function affine(from, to) {
  const [[x0, y0], [x1, y1], [x2, y2]] = from;
  const determinant = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
  if (Math.abs(determinant) < 1e-6) return null;
  const row = (i) => {
    const [u0, u1, u2] = to.map((point) => point[i]);
    const across = ((u1 - u0) * (y2 - y0) - (u2 - u0) * (y1 - y0)) / determinant;
    const down = ((u2 - u0) * (x1 - x0) - (u1 - u0) * (x2 - x0)) / determinant;
    return [across, down, u0 - across * x0 - down * y0];
  };
  const [[a, c, e], [b, d, f]] = [row(0), row(1)];
  return [a, b, c, d, e, f];
}

// Moves the corners outwards by about `px`, so that no seam shows between neighbours.
function grown(triangle, px) {
  const [mx, my] = [0, 1].map((i) => (triangle[0][i] + triangle[1][i] + triangle[2][i]) / 3);
  return triangle.map(([x, y]) => {
    const factor = 1 + px / (Math.hypot(x - mx, y - my) || 1);
    return [mx + (x - mx) * factor, my + (y - my) * factor];
  });
}

// The triangles whose corners are all trusted: { reference, query }, three points each, in pixels.
export function triangles({ columns, rows, points, trusted, reference_width: width, reference_height: height }) {
  const corner = (row, column) => {
    const number = row * columns + column;
    return { reference: [((width - 1) * column) / (columns - 1), ((height - 1) * row) / (rows - 1)],
             query: points[number], trusted: trusted?.[number] ?? true };
  };
  const list = [];
  const add = (...corners) => {
    if (!corners.every((one) => one.trusted)) return;
    list.push({ reference: corners.map((one) => one.reference), query: corners.map((one) => one.query) });
  };
  for (let row = 0; row + 1 < rows; ++row) {
    for (let column = 0; column + 1 < columns; ++column) {
      const [a, b, c, d] = [corner(row, column), corner(row, column + 1), corner(row + 1, column), corner(row + 1, column + 1)];
      add(a, b, d);
      add(a, d, c);
    }
  }
  return list;
}

// Draws into `context`, whose canvas shows the reference at `scale` canvas pixels per reference pixel. `bitmap`: the
// photo at any size; queryWidth: its width in the mesh. Pixel centres are at integers in the mesh, at halves on the canvas.
export function drawFlattened(context, bitmap, queryWidth, mesh, scale) {
  const shrink = bitmap.width / queryWidth;
  for (const { reference, query } of triangles(mesh)) {
    const to = reference.map(([x, y]) => [(x + 0.5) * scale, (y + 0.5) * scale]);
    const from = query.map(([x, y]) => [(x + 0.5) * shrink, (y + 0.5) * shrink]);
    const map = affine(from, to);
    if (!map) continue;
    context.save();
    context.beginPath();
    for (const [x, y] of grown(to, 0.75)) context.lineTo(x, y);
    context.closePath();
    context.clip();
    context.transform(...map);
    drawPart(context, bitmap, from);
    context.restore();
  }
}

// Draws only the part around the triangle: far faster than the whole photo for each.
function drawPart(context, bitmap, corners) {
  const [xs, ys] = [0, 1].map((i) => corners.map((point) => point[i]));
  const left = Math.max(0, Math.floor(Math.min(...xs)) - 2);
  const top = Math.max(0, Math.floor(Math.min(...ys)) - 2);
  const width = Math.min(bitmap.width, Math.ceil(Math.max(...xs)) + 2) - left;
  const height = Math.min(bitmap.height, Math.ceil(Math.max(...ys)) + 2) - top;
  if (width > 0 && height > 0) context.drawImage(bitmap, left, top, width, height, left, top, width, height);
}

// Corners of the convex hull (monotone chain).
export function convexHull(points) {
  const sorted = [...points].sort((p, q) => p[0] - q[0] || p[1] - q[1]);
  if (sorted.length < 3) return sorted;
  const half = (list) => {
    const chain = [];
    for (const p of list) {
      while (chain.length > 1) {
        const [a, b] = chain.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}
