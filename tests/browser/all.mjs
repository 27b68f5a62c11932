// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Every case, one after the other: they share the machine's cores with the server.
import "./cases/visit.mjs";
import "./cases/search.mjs";
import "./cases/again.mjs";
import "./cases/answer.mjs";
import "./cases/several.mjs";
import "./cases/phone.mjs";
import "./cases/region.mjs";
import "./cases/add.mjs";
import "./cases/browse.mjs";
import "./cases/image.mjs";
import "./cases/edit.mjs";
import "./cases/collection.mjs";
import "./cases/selftest.mjs";
import "./cases/docs.mjs";
import "./cases/proxy.mjs";
import "./cases/status.mjs";
import "./cases/backups.mjs";
import "./cases/incoming.mjs";
import "./cases/fetched.mjs";
import "./cases/keys.mjs";
import "./cases/admin.mjs";
import "./cases/camera.mjs";
import "./cases/select.mjs";
import "./cases/walk.mjs";
import "./cases/looks.mjs";
import "./cases/modules.mjs";
import "./cases/texts.mjs";
