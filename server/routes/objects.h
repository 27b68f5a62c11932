// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Objects as JSON.
#pragma once

#include <string>

#include "index/json/json.h"
#include "index/records/records.h"
#include "server/routes/service.h"

namespace pliant::server {

// `image_id`: one of its images, to show it by; empty becomes null: the last one just went.
Json ObjectJson(const ObjectRecord& object, const std::string& image_id);
// With the first of its images there are at the moment.
Json ObjectJson(Service& service, const std::string& collection, const ObjectRecord& object);

}  // namespace pliant::server
