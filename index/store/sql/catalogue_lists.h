// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lists of images and objects in SQL, and what is removed by the same conditions. Private to
// index/store/; each in the transaction of `db`.
#pragma once

#include <cstdint>

#include "index/records/listing.h"
#include "index/store/sql/connection.h"
#include "index/store/sql/rows.h"

namespace pliant {

// Throw kInvalidArgument "after_invalid" for a place that is none of the order asked for.
ImagePage SelectImagePage(Connection& db, Key collection, const ImageListing& list);
ObjectPage SelectObjectPage(Connection& db, Key collection, const ObjectListing& list);

// How many. Also removes objects that have no image left.
std::uint64_t DeleteImagesWhere(Connection& db, Key collection, const Selection& which);

}  // namespace pliant
