// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page put together.
import { addView as add } from "./add.js";
import { objectsView, picturesView } from "./browse.js";
import { collectionView } from "./collection.js";
import { byId } from "./dom.js";
import { refreshHeader } from "./header.js";
import { purgeQueries } from "./kept.js";
import { refreshMe } from "./me.js";
import { addView, showing, startRouter, whenCollectionChanges } from "./router.js";
import { searchView } from "./search.js";
import { notify } from "./undo.js";

// A view whose files are fetched when it is first wanted. load() gives the view.
function addLater(name, title, load) {
  let view = null;
  addView(name, {
    title,
    async show(...given) {
      try {
        view ??= await load();
      } catch {
        notify("A part of this page could not be fetched. Is the server running? Reload the page to try again.", true);
        return;
      }
      if (showing() === name) await view.show(...given);
    },
    hide() { view?.hide?.(); },
  });
}

addView("search", searchView);
addView("add", add);
addView("objects", objectsView);
addView("pictures", picturesView);
addView("collection", collectionView);
addLater("object", "Object", async () => (await import("./object.js")).objectView);
addLater("camera", "Camera", async () => (await import("./camera.js")).cameraView);
addLater("keys", "Keys", async () => (await import("./keys.js")).keysView);
addLater("status", "Status", async () => (await import("./status.js")).statusView);
addLater("picture", "Picture", async () => (await import("./picture.js")).pictureView);

// A file dropped beside the frames must not replace the page.
for (const type of ["dragover", "drop"]) addEventListener(type, (event) => event.preventDefault());

// The address behind # is the router's.
byId("skip").addEventListener("click", (event) => {
  event.preventDefault();
  byId("main").focus();
});

whenCollectionChanges(refreshHeader);
purgeQueries().catch(() => {});  // where the browser keeps nothing there is nothing to purge
startRouter();
refreshHeader();
refreshMe().catch(() => {});  // the view says what is wrong
