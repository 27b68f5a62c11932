// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is on a canvas of the page.

// Share of the canvas that has exactly the outline's colour, and that is not transparent.
export function canvasShares(page, selector) {
  return page.locator(selector).evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let outline = 0, opaque = 0;
    for (let i = 0; i < data.length; i += 4) {
      if (data[i + 3] > 200) ++opaque;
      if (data[i] === 0xff && data[i + 1] === 0xd8 && data[i + 2] === 0x4d) ++outline;
    }
    const pixels = data.length / 4;
    return { outline: outline / pixels, opaque: opaque / pixels };
  });
}

// Correlation of the detail (grey values less their surroundings, so that shading does not count) of
// two canvases where both are opaque: 1 = the same image, about 0 = unrelated. `shift` moves one of
// them to the side by so many hundredths of its width: what chance alone gives.
export function correlation(page, one, other, shift = 0) {
  return page.evaluate(([a, b, offset]) => {
    const side = 200, reach = 4;
    const detail = (selector, dx) => {
      const small = new OffscreenCanvas(side, side).getContext("2d");
      small.drawImage(document.querySelector(selector), (dx * side) / 100, 0, side, side);
      const { data } = small.getImageData(0, 0, side, side);
      const grey = (x, y) => {
        const i = 4 * (y * side + x);
        return data[i + 3] < 250 ? NaN : data[i] + data[i + 1] + data[i + 2];
      };
      const list = [];
      for (let y = reach; y < side - reach; ++y) {
        for (let x = reach; x < side - reach; ++x) {
          let sum = 0;
          for (let v = -reach; v <= reach; ++v) for (let u = -reach; u <= reach; ++u) sum += grey(x + u, y + v);
          list.push(grey(x, y) - sum / (2 * reach + 1) ** 2);
        }
      }
      return list;
    };
    const [p, q] = [detail(a, 0), detail(b, offset)];
    let n = 0, sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0;
    for (let i = 0; i < p.length; ++i) {
      const [x, y] = [p[i], q[i]];
      if (Number.isNaN(x + y)) continue;
      n += 1; sx += x; sy += y; sxx += x * x; syy += y * y; sxy += x * y;
    }
    return (n * sxy - sx * sy) / Math.sqrt((n * sxx - sx * sx) * (n * syy - sy * sy));
  }, [one, other, shift]);
}
