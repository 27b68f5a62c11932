// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The object flattened: the query picture, pulled back through the warp that verification found.
// The warp comes as a mesh: `columns` x `rows` points, regular in the reference picture, each with
// its place in the query picture. Every cell is two triangles, every triangle one affine map.

// The affine map (a, b, c, d, e, f of a canvas transform) that takes triangle `from` to `to`; null
// where `from` has no area.
export function affine(from, to) {
  const [[x0, y0], [x1, y1], [x2, y2]] = from;
  const determinant = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
  if (Math.abs(determinant) < 1e-6) return null;
  const row = (u0, u1, u2) => {
    const across = ((u1 - u0) * (y2 - y0) - (u2 - u0) * (y1 - y0)) / determinant;
    const down = ((u2 - u0) * (x1 - x0) - (u1 - u0) * (x2 - x0)) / determinant;
    return [across, down, u0 - across * x0 - down * y0];
  };
  const [a, c, e] = row(to[0][0], to[1][0], to[2][0]);
  const [b, d, f] = row(to[0][1], to[1][1], to[2][1]);
  return [a, b, c, d, e, f];
}

// Moves the corners of a triangle outwards by about `px`, so that no seam shows between neighbours.
function grown(triangle, px) {
  const mx = (triangle[0][0] + triangle[1][0] + triangle[2][0]) / 3;
  const my = (triangle[0][1] + triangle[1][1] + triangle[2][1]) / 3;
  return triangle.map(([x, y]) => {
    const length = Math.hypot(x - mx, y - my) || 1;
    const factor = 1 + px / length;
    return [mx + (x - mx) * factor, my + (y - my) * factor];
  });
}

// The triangles of a mesh whose corners can be believed: { reference: 3 points in reference pixels, query: 3 in query pixels }.
export function triangles(mesh) {
  const { columns, rows, points } = mesh;
  const corner = (row, column) => {
    const x = ((mesh.reference_width - 1) * column) / (columns - 1);
    const y = ((mesh.reference_height - 1) * row) / (rows - 1);
    const number = row * columns + column;
    return { reference: [x, y], query: points[number], trusted: mesh.trusted?.[number] ?? true };
  };
  const list = [];
  const add = (...corners) => {
    if (!corners.every((one) => one.trusted)) return;
    list.push({ reference: corners.map((one) => one.reference),
                query: corners.map((one) => one.query) });
  };
  for (let row = 0; row + 1 < rows; ++row) {
    for (let column = 0; column + 1 < columns; ++column) {
      const [a, b] = [corner(row, column), corner(row, column + 1)];
      const [c, d] = [corner(row + 1, column), corner(row + 1, column + 1)];
      add(a, b, d);
      add(a, d, c);
    }
  }
  return list;
}

// Draws the flattened object into `context`, whose canvas shows the reference at `scale` canvas
// pixels a reference pixel. `picture` is the query, any size: query_width is that of its pixels in
// the mesh. Pixel centres are at integers in the mesh and at halves on the canvas.
export function drawFlattened(context, picture, queryWidth, mesh, scale) {
  const shrink = picture.width / queryWidth;
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
    drawPart(context, picture, from);
    context.restore();
  }
}

// Only the part of the picture around the triangle: far faster than the whole for each.
function drawPart(context, picture, corners) {
  const xs = corners.map(([x]) => x);
  const ys = corners.map(([, y]) => y);
  const left = Math.max(0, Math.floor(Math.min(...xs)) - 2);
  const top = Math.max(0, Math.floor(Math.min(...ys)) - 2);
  const right = Math.min(picture.width, Math.ceil(Math.max(...xs)) + 2);
  const bottom = Math.min(picture.height, Math.ceil(Math.max(...ys)) + 2);
  if (right <= left || bottom <= top) return;  // outside the picture: nothing was seen there
  context.drawImage(picture, left, top, right - left, bottom - top,
                    left, top, right - left, bottom - top);
}

// Corners of the convex hull (monotone chain), for the part of the reference that was recognised.
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
