// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The live camera: frames are searched with until an object is found, and the object is then followed (located in each
// frame) until it is lost. Frames go to the server one at a time and are not kept.
import * as api from "./api.js";
import { byId, make, say, wait } from "./dom.js";
import { drawOutline } from "./draw.js";
import { objectName } from "./names.js";
import { link } from "./router.js";
import { isFound } from "./words.js";

const kFrameSide = 640;      // longer side of a frame that is sent, in pixels
const kQuality = 0.8;
const kPauseMs = 60;         // between frames
const kRestMs = 400;         // after a frame without a find
const kLostAfter = 4;        // frames without the followed object
const kShownForMs = 1500;    // an older outline says nothing

const [video, overlay, status] = ["camera-video", "camera-overlay", "camera-status"].map(byId);

let stream = null;
let round = 0;          // of the loop; a loop of an earlier round stops
let followed = null;    // { object, name }
let misses = 0;
let outline = null;     // { polygon, width, height, at }
let facing = "environment";

const kFailures = {
  NotAllowedError: "The browser does not allow this page to use the camera. Allow it in the browser's settings, then start again.",
  NotFoundError: "This device has no camera.",
  NotReadableError: "Another program is using the camera.",
  OverconstrainedError: "This camera cannot be used.",
};
const kNotSecure = "Browsers allow the camera only on pages over https, or from this computer itself. " +
  "Ask the person who runs this server to turn on TLS (--tls-cert), or take a photo instead.";

const tell = (text, isError) => say(status, text, isError);

async function start() {
  stop();
  const mine = ++round;
  if (!navigator.mediaDevices?.getUserMedia) {
    tell(kNotSecure, true);
    return;
  }
  tell("Starting the camera…");
  let given = null;
  try {
    given = await navigator.mediaDevices.getUserMedia({ audio: false, video: { facingMode: facing, width: { ideal: 1280 }, height: { ideal: 720 } } });
  } catch (error) {
    if (mine === round) tell(kFailures[error.name] ?? "The camera cannot be started.", true);
    return;
  }
  if (mine !== round) {  // the view was left meanwhile
    for (const track of given.getTracks()) track.stop();
    return;
  }
  stream = given;
  stream.getVideoTracks()[0]?.addEventListener("ended", () => { if (mine === round) stop("The camera has stopped."); });
  video.srcObject = stream;
  await video.play().catch(() => {});
  showButtons();
  const cameras = (await navigator.mediaDevices.enumerateDevices()).filter(({ kind }) => kind === "videoinput");
  byId("camera-switch").hidden = cameras.length < 2;
  tell("Searching…");
  draw(mine);
  search(mine);
}

function stop(words = "") {
  ++round;
  for (const track of stream?.getTracks() ?? []) track.stop();
  stream = video.srcObject = null;
  letGo();
  overlay.getContext("2d").clearRect(0, 0, overlay.width, overlay.height);
  showButtons();
  tell(words);
}

function showButtons() {
  byId("camera-start").hidden = Boolean(stream);
  byId("camera-stop").hidden = byId("camera-frame").hidden = !stream;
  if (!stream) byId("camera-switch").hidden = true;
}

async function grab() {
  const scale = Math.min(1, kFrameSide / Math.max(video.videoWidth, video.videoHeight));
  const canvas = new OffscreenCanvas(Math.round(video.videoWidth * scale), Math.round(video.videoHeight * scale));
  canvas.getContext("2d").drawImage(video, 0, 0, canvas.width, canvas.height);
  const blob = await canvas.convertToBlob({ type: "image/jpeg", quality: kQuality });
  return { file: new File([blob], "camera.jpg", { type: blob.type }), width: canvas.width, height: canvas.height };
}

// --- searching and following

function follow({ object, source, image_id: id }) {
  followed = { object, name: objectName(object, source) };
  misses = 0;
  byId("camera-found").hidden = false;
  byId("camera-name").replaceChildren(make("a", { href: object ? link("object", { name: object }) : link("image", { id }), text: followed.name }));
}

function letGo() {
  followed = outline = null;
  byId("camera-found").hidden = true;
}

const showOutline = (polygon, { width, height }) => { outline = polygon ? { polygon, width, height, at: performance.now() } : null; };

// Whether this frame shows anything.
async function searchFrame(frame) {
  const { hits: [best] } = await api.search(frame, { limit: 1 });
  if (!best || !isFound(best)) {
    tell("Searching…");
    return false;
  }
  follow(best);
  showOutline(best.polygon, frame);
  tell(`Found: ${followed.name}.`);
  return true;
}

async function followFrame(frame) {
  const where = await api.locate(followed.object, frame.file);
  if (!followed) return true;  // let go meanwhile
  if (where.found) {
    misses = 0;
    showOutline(where.outline, where);
    tell(`Following: ${followed.name}.`);
    return true;
  }
  if (++misses >= kLostAfter) {
    tell(`Lost: ${followed.name}. Searching…`);
    letGo();
  }
  return false;
}

async function search(mine) {
  while (mine === round) {
    let rest = kRestMs;
    try {
      if (!document.hidden && video.videoWidth) {
        const frame = await grab();
        if (mine !== round) return;
        if (await (followed?.object ? followFrame(frame) : searchFrame(frame))) rest = kPauseMs;
      }
    } catch (error) {
      if (mine !== round) return;
      rest = kPauseMs;
      if (error.code === "object_not_found") letGo();
      else if (error.code === "too_few_features") tell("There is too little detail. More light may help.");
      else if (error.status === 429 || error.status === 503) {
        tell("The server is busy…");
        rest = 1000 * Math.max(1, error.retryAfterS);
      } else {
        stop();
        tell(error.message, true);
        return;
      }
    }
    await wait(rest);
  }
}

function draw(mine) {
  if (mine !== round) return;
  if (video.videoWidth && (overlay.width !== video.videoWidth || overlay.height !== video.videoHeight)) {
    overlay.width = video.videoWidth;
    overlay.height = video.videoHeight;
  }
  const context = overlay.getContext("2d");
  context.clearRect(0, 0, overlay.width, overlay.height);
  if (outline && performance.now() - outline.at < kShownForMs) {
    drawOutline(context, outline.polygon, overlay.width / outline.width, undefined, 1.5);
  }
  requestAnimationFrame(() => draw(mine));
}

byId("camera-start").addEventListener("click", start);
byId("camera-stop").addEventListener("click", () => { stop(); byId("camera-start").focus(); });
byId("camera-let-go").addEventListener("click", () => { letGo(); byId("camera-stop").focus(); });
byId("camera-switch").addEventListener("click", () => {
  facing = facing === "environment" ? "user" : "environment";
  start();
});

export const show = start;
export const hide = () => stop();
