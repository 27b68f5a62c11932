// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images of kinds that the server does not read, converted by the browser if it can show them. The first bytes tell the
// kind, not the name.

const kQuality = 0.95;
const kLongestSide = 8192;  // of a converted image, in pixels; canvases have an end

const kServerReads = ["JPEG", "PNG", "WebP", "BMP", "TIFF"];
const kAdvice = {
  HEIC: "On an iPhone, choose Settings > Camera > Formats > Most Compatible. On a computer, export the photo as JPEG.",
  SVG: "An SVG is a drawing, not a photo. Save it as PNG first.",
  PDF: "A PDF is a document, not a photo. Save the page as PNG first.",
  video: "A video is not a photo. Save a frame as JPEG first.",
};

const text = (bytes, from, to) => String.fromCharCode(...bytes.slice(from, to));

// "JPEG", "HEIC", ...; null if unknown.
export function kindOf(bytes) {
  const starts = (...values) => values.every((value, i) => bytes[i] === value);
  if (starts(0xff, 0xd8, 0xff)) return "JPEG";
  if (starts(0x89, 0x50, 0x4e, 0x47)) return "PNG";
  if (text(bytes, 0, 4) === "RIFF" && text(bytes, 8, 12) === "WEBP") return "WebP";
  if (starts(0x42, 0x4d)) return "BMP";
  if (["II*\0", "MM\0*"].includes(text(bytes, 0, 4))) return "TIFF";
  if (text(bytes, 0, 4) === "GIF8") return "GIF";
  if (text(bytes, 0, 4) === "%PDF") return "PDF";
  if (starts(0, 0, 1, 0)) return "ICO";
  if (starts(0xff, 0x0a) || text(bytes, 4, 8) === "JXL ") return "JPEG XL";
  if (text(bytes, 4, 8) === "ftyp") {
    const brands = text(bytes, 8, 64);
    if (/^avi[fs]/.test(brands)) return "AVIF";
    if (/^(hei|hev|mif1|msf1)/.test(brands)) return /avif/.test(brands) ? "AVIF" : "HEIC";
    return "video";
  }
  if (starts(0x1a, 0x45, 0xdf, 0xa3)) return "video";
  return /^\s*(<\?xml[^]*)?<svg/i.test(text(bytes, 0, 256)) ? "SVG" : null;
}

// The same file, or a converted one. Throws an Error with a sentence.
export async function readable(file) {
  const kind = kindOf(new Uint8Array(await file.slice(0, 256).arrayBuffer()));
  if (kind === null || kServerReads.includes(kind)) return file;
  const bitmap = kind === "SVG" ? null : await createImageBitmap(file).catch(() => null);
  if (!bitmap) {
    const advice = kAdvice[kind] ?? "Save it as JPEG or PNG first.";
    throw new Error(["SVG", "PDF", "video"].includes(kind) ? advice : `${kind} images cannot be read here. ${advice}`);
  }
  const scale = Math.min(1, kLongestSide / Math.max(bitmap.width, bitmap.height));
  const canvas = new OffscreenCanvas(Math.round(bitmap.width * scale), Math.round(bitmap.height * scale));
  const context = canvas.getContext("2d");
  context.fillStyle = "#fff";  // below transparent pixels
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  bitmap.close();
  const [type, ending] = kind === "GIF" ? ["image/png", "png"] : ["image/jpeg", "jpg"];
  const blob = await canvas.convertToBlob({ type, quality: kQuality });
  return new File([blob], `${file.name.replace(/\.[^.]{1,5}$/, "")}.${ending}`, { type, lastModified: file.lastModified });
}
