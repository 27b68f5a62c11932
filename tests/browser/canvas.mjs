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

// Correlation of the grey values of two canvases where both are opaque, at a coarse size: 1 = the
// same picture but for brightness and contrast.
export function correlation(page, one, other) {
  return page.evaluate(([a, b]) => {
    const side = 96;
    const grey = (selector) => {
      const small = new OffscreenCanvas(side, side).getContext("2d");
      small.drawImage(document.querySelector(selector), 0, 0, side, side);
      return small.getImageData(0, 0, side, side).data;
    };
    const [p, q] = [grey(a), grey(b)];
    let n = 0, sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0;
    for (let i = 0; i < p.length; i += 4) {
      if (p[i + 3] < 250 || q[i + 3] < 250) continue;
      const x = p[i] + p[i + 1] + p[i + 2];
      const y = q[i] + q[i + 1] + q[i + 2];
      n += 1; sx += x; sy += y; sxx += x * x; syy += y * y; sxy += x * y;
    }
    return (n * sxy - sx * sy) / Math.sqrt((n * sxx - sx * sx) * (n * syy - sy * sy));
  }, [one, other]);
}
