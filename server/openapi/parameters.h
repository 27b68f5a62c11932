// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Parameters in the OpenAPI document.
#pragma once

#include <string>

#include "server/openapi/document.h"

namespace pliant::server {

// In words, what a picture may be.
inline constexpr const char* kBinaryImage = "a picture: JPEG, PNG, WebP, BMP or TIFF";

// Properties of JSON objects in which a picture may stand, and that one of them must.
Json PictureProperties();
Json EitherPicture();

Json SchemaOf(const Parameter& parameter);
// Every parameter may stand in the query, whatever the body is. `only`: and nowhere else.
Json QueryParameter(const Parameter& parameter, bool only);
Json PathParameter(const std::string& name);

}  // namespace pliant::server
