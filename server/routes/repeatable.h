// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Idempotency-Key: a client that does not know what became of its request sends it again, and it is
// not done twice (draft-ietf-httpapi-idempotency-key-header-07).
//
// A request is what it asks for: method, path, query and body, each part of a form by itself, since
// boundaries differ from one sending to the next. Answers of success are remembered in the database
// for a day and given again, by any server on it, with the header Idempotency-Replayed. What failed
// is done anew. So is what a server began that died before it answered: images that it had added
// are found to be there, by their bytes; only a job may then be begun twice.
#pragma once

#include "server/http/router.h"
#include "server/routes/service.h"

namespace pliant::server {

// The route's handler, which heeds the header. Throws ProblemError "invalid_parameter" for a key
// that is none, "idempotency_running" while the same request is done, "idempotency_other" when
// another request had the key. `service` must outlive it.
Handler Repeatable(Service& service, Handler handler);

}  // namespace pliant::server
