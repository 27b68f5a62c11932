// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Adding an image, shared by several routes.
#pragma once

#include "server/routes/service.h"

namespace pliant::server {

// Runs on the pool, updates the metrics, and notifies the automatic training.
AddResult AddOnPool(Service& service, const AddRequest& request, const ImageCheck& check = {});

Parameter ObjectParameter();
Parameter MetadataParameter();

}  // namespace pliant::server
