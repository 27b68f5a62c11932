// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The camera, live: frames are searched with until an object is found, which is then followed (located in each frame)
// until it is lost. Frames go to the server one at a time and are not kept.
import * as api from "./api.js";
import { byId, make, say } from "./dom.js";
import { drawOutline } from "./draw.js";
import { objectName } from "./names.js";
import { link } from "./router.js";
import { isFound } from "./words.js";

const kFrameSide = 640;      // longer side of what is sent, in pixels
const kQuality = 0.8;
const kPauseMs = 60;         // between frames
const kRestMs = 400;         // after a frame in which nothing was found
const kLostAfter = 4;        // frames without the object that is followed
const kShownForMs = 1500;    // an outline that is older says nothing

const video = byId("camera-video");
const overlay = byId("camera-overlay");
const status = byId("camera-status");

let stream = null;
let round = 0;          // of the loop; a number that has passed means stop
let followed = null;    // { object, image_id, name }
let misses = 0;
let outline = null;     // { polygon, width, height, at }
let facing = "environment";
let told = "";

// --- the picture

const failureWords = (error) => ({
  NotAllowedError: "The browser does not let this page use the camera. Allow it in the browser's settings for this page, then start again.",
  NotFoundError: "This device has no camera.",
  NotReadableError: "Another program uses the camera.",
  OverconstrainedError: "This camera cannot be used.",
}[error.name] ?? "The camera cannot be started.");

const kNotSecure = "Browsers give the camera only to pages that came over https, or from this computer itself. " +
  "Ask whoever runs this server to turn on TLS (--tls-cert), or take a photo instead.";

function tell(text, isError = false) {
  if (text === told) return;  // a screen reader says it once
  told = text;
  say(status, text, isError);
}

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
    if (mine === round) tell(failureWords(error), true);
    return;
  }
  if (mine !== round) {  // one has left meanwhile
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
  tell("Looking…");
  draw(mine);
  look(mine);
}

function stop(words = "") {
  ++round;
  for (const track of stream?.getTracks() ?? []) track.stop();
  stream = null;
  video.srcObject = null;
  outline = null;
  letGo();
  overlay.getContext("2d").clearRect(0, 0, overlay.width, overlay.height);
  showButtons();
  tell(words);
}

function showButtons() {
  byId("camera-start").hidden = Boolean(stream);
  byId("camera-stop").hidden = !stream;
  byId("camera-frame").hidden = !stream;
  if (!stream) byId("camera-switch").hidden = true;
}

function grab() {
  const scale = Math.min(1, kFrameSide / Math.max(video.videoWidth, video.videoHeight));
  const canvas = new OffscreenCanvas(Math.round(video.videoWidth * scale), Math.round(video.videoHeight * scale));
  canvas.getContext("2d").drawImage(video, 0, 0, canvas.width, canvas.height);
  return canvas.convertToBlob({ type: "image/jpeg", quality: kQuality })
    .then((blob) => ({ file: new File([blob], "camera.jpg", { type: blob.type }), width: canvas.width, height: canvas.height }));
}

// --- looking and following

function follow(hit) {
  followed = { object: hit.object, name: objectName(hit.object, hit.source), image_id: hit.image_id };
  misses = 0;
  byId("camera-found").hidden = false;
  byId("camera-name").replaceChildren(make("a", { href: followed.object ? link("object", { name: followed.object }) : link("picture", { id: hit.image_id }),
                                                 text: followed.name }));
}

function letGo() {
  followed = null;
  byId("camera-found").hidden = true;
}

const showOutline = (polygon, { width, height }) => { outline = polygon ? { polygon, width, height, at: performance.now() } : null; };

// Whether anything was seen in this frame.
async function searchFrame(frame) {
  const { hits } = await api.search(frame, { limit: 1 });
  const best = hits[0];
  if (!best || !isFound(best)) {
    tell("Looking…");
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
    showOutline(where.outline, { width: where.width, height: where.height });
    tell(`Following: ${followed.name}.`);
    return true;
  }
  if (++misses >= kLostAfter) {
    tell(`Lost: ${followed.name}. Looking…`);
    letGo();
  }
  return false;
}

async function look(mine) {
  while (mine === round) {
    let rest = kPauseMs;
    try {
      if (document.hidden || !video.videoWidth) rest = kRestMs;
      else {
        const frame = await grab();
        if (mine !== round) return;
        const seen = followed?.object ? await followFrame(frame) : await searchFrame(frame);
        rest = seen ? kPauseMs : kRestMs;
      }
    } catch (error) {
      if (mine !== round) return;
      if (error.code === "object_not_found") letGo();
      else if (error.code === "too_few_features") tell("There is too little detail to see. Is it too dark?");
      else if (error.status === 429 || error.status === 503) {
        tell("The server is busy…");
        rest = 1000 * Math.max(1, error.retryAfterS);
      } else {
        stop();
        tell(error.message, true);
        return;
      }
    }
    await new Promise((wake) => setTimeout(wake, rest));
  }
}

// --- the outline over the picture

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
byId("camera-let-go").addEventListener("click", () => { letGo(); outline = null; byId("camera-stop").focus(); });
byId("camera-switch").addEventListener("click", () => {
  facing = facing === "environment" ? "user" : "environment";
  start();
});

export const cameraView = { title: "Camera", show: start, hide: () => stop() };
