// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the person at the page may do. Elements that need more have data-needs="write" or "admin" and are
// hidden by the style sheet; those with data-only="read" are for people who may only read.
import { ask } from "./api.js";

const kScopes = ["admin", "write", "read"];  // each includes those after it

let fetches = false;
let tell;
const told = new Promise((done) => { tell = done; });

// Throws the Problem of a key that does not work. Who cannot be asked keeps what is known.
export async function refreshMe() {
  try {
    const { scopes, image_url: isFetching } = await ask("/v1/me");
    fetches = isFetching;
    document.documentElement.dataset.scope = kScopes.find((scope) => scopes.includes(scope)) ?? "read";
  } finally {
    tell();
  }
}

export const mayWrite = () => document.documentElement.dataset.scope !== "read";
// Whether the server fetches pictures by their addresses, from the hosts that its operator allows; waits until that
// is known.
export const mayFetch = () => told.then(() => fetches);
export const isAdmin = () => document.documentElement.dataset.scope === "admin";
