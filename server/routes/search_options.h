// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a search takes, and what it is asked with.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "index/records/search.h"
#include "server/http/parameters.h"
#include "server/routes/uploaded_image.h"

namespace pliant::server {

// Without "draw" and "preview", which are for a single search.
std::vector<Parameter> SearchParameters();

// What is searched with: an image that was sent, one that is stored, or several of those.
struct SearchQuery {
  UploadedImage image;  // when both others are absent
  std::optional<std::string> image_id;
  std::vector<std::string> image_ids;  // empty = absent
  SearchOptions options;
};

// Throws ProblemError that names the parameter, and what ImageOf throws.
SearchQuery SearchQueryOf(const Request& request, const Parameters& parameters,
                          const std::string& collection, Fetcher& fetcher,
                          Fetcher::For whom = Fetcher::For::kRequest);

}  // namespace pliant::server
