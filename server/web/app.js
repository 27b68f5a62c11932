// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page put together.
import { addView as add } from "./add.js";
import { refreshScope } from "./api.js";
import { imagesView, objectView, objectsView } from "./browse.js";
import { collectionView } from "./collection.js";
import { byId } from "./dom.js";
import { refreshHeader } from "./header.js";
import { purgeQueries } from "./kept.js";
import { addView, showing, startRouter, whenCollectionChanges } from "./router.js";
import { searchView } from "./search.js";
import { t } from "./texts.js";
import { notify } from "./undo.js";

addView("search", searchView);
addView("add", add);
addView("objects", objectsView);
addView("images", imagesView);
addView("object", objectView);
addView("collection", collectionView);

// The files of these views are fetched at first use. Each exports show and perhaps hide.
const kTitles = { image: t`Image`, camera: t`Camera`, keys: t`Keys`, status: t`Status` };
for (const [name, title] of Object.entries(kTitles)) {
  let view = null;
  addView(name, {
    title,
    async show(...given) {
      try {
        view ??= await import(`./${name}.js`);
      } catch {
        notify(t`A part of this page could not be loaded. Check that the server is running, and reload the page.`, true);
        return;
      }
      if (showing() === name) await view.show(...given);
    },
    hide() { view?.hide?.(); },
  });
}

// A file that misses the drop area must not replace the page.
for (const type of ["dragover", "drop"]) addEventListener(type, (event) => event.preventDefault());

// The address behind # is the router's.
byId("skip").addEventListener("click", (event) => {
  event.preventDefault();
  byId("main").focus();
});

whenCollectionChanges(refreshHeader);
purgeQueries().catch(() => {});  // the browser may keep nothing
startRouter();
refreshHeader();
refreshScope().catch(() => {});  // the view says what is wrong
