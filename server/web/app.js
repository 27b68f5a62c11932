// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page put together.
import { addView as add } from "./add.js";
import { objectsView, picturesView } from "./browse.js";
import { collectionView } from "./collection.js";
import { byId } from "./dom.js";
import { refreshHeader } from "./header.js";
import { purgeQueries } from "./kept.js";
import { addView, startRouter, whenCollectionChanges } from "./router.js";
import { searchView } from "./search.js";

addView("search", searchView);
addView("add", add);
addView("objects", objectsView);
addView("pictures", picturesView);
addView("collection", collectionView);

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
