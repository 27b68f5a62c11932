// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Adding a picture, as the routes that do so share it.
#pragma once

#include "server/routes/service.h"

namespace pliant::server {

// On the pool, counted in the metrics, heard of by the automatic training.
AddResult AddOnPool(Service& service, const AddRequest& request);

// "created", "replaced", "unchanged"
const char* OutcomeName(AddOutcome outcome);

Parameter ObjectParameter();
Parameter MetadataParameter();

}  // namespace pliant::server
