// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Pictures of kinds that the server does not read (GIF, AVIF, HEIC, ...), converted by the browser where it can show
// them; where it cannot, why it does not work. Kinds are told by the first bytes, not by names.

const kQuality = 0.95;
const kLongestSide = 8192;  // of a converted picture, in pixels; canvases have an end

const kServerReads = ["JPEG", "PNG", "WebP", "BMP", "TIFF"];
const kSaveAs = "Save it as JPEG or PNG first.";
const kAdvice = {
  HEIC: "On an iPhone, Settings > Camera > Formats > Most Compatible takes JPEG; on a computer, export the picture as JPEG.",
  SVG: "An SVG is a drawing, not a photograph. Save it as PNG first.",
  PDF: "A PDF is a document, not a picture. Save the page as PNG first.",
  video: "A video is no picture. Take a still of it, or a photograph.",
};

const text = (bytes, from, to) => String.fromCharCode(...bytes.slice(from, to));

// "JPEG", "HEIC", ...; null for what is not known here.
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
  if (/^\s*(<\?xml[^]*)?<svg/i.test(text(bytes, 0, 256))) return "SVG";
  return null;
}

// A file that the server reads: the same one, or a converted one. Throws an Error in words.
export async function readable(file) {
  const kind = kindOf(new Uint8Array(await file.slice(0, 256).arrayBuffer()));
  if (kind === null || kServerReads.includes(kind)) return file;
  const picture = kind === "SVG" ? null : await createImageBitmap(file).catch(() => null);
  if (!picture) {
    throw new Error(kAdvice[kind] && kind !== "HEIC" ? kAdvice[kind] :
      `This is a picture of the kind ${kind}, which neither this browser nor the server can read. ${kAdvice[kind] ?? kSaveAs}`);
  }
  const scale = Math.min(1, kLongestSide / Math.max(picture.width, picture.height));
  const canvas = new OffscreenCanvas(Math.round(picture.width * scale), Math.round(picture.height * scale));
  const context = canvas.getContext("2d");
  context.fillStyle = "#fff";  // what is seen through a picture
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(picture, 0, 0, canvas.width, canvas.height);
  picture.close();
  const [type, ending] = kind === "GIF" ? ["image/png", "png"] : ["image/jpeg", "jpg"];
  const blob = await canvas.convertToBlob({ type, quality: kQuality });
  return new File([blob], `${file.name.replace(/\.[^.]{1,5}$/, "")}.${ending}`, { type, lastModified: file.lastModified });
}
