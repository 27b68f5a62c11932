// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/search_options.h"

#include <algorithm>
#include <cstdint>

#include "server/routes/lists.h"

namespace pliant::server {

namespace {

constexpr std::int64_t kLargestOffset = 1'000'000;
constexpr std::int64_t kLargestLimit = 1'000;
constexpr std::int64_t kLargestDepth = 10'000;
constexpr std::int64_t kMostInstances = 100;
constexpr double kLargestCoordinate = 1e6;
Region RegionOf(const std::vector<double>& numbers) {
  const Region region{numbers[0], numbers[1], numbers[2], numbers[3]};
  for (const double number : numbers) {
    if (number < -kLargestCoordinate || number > kLargestCoordinate) {
      ThrowInvalid("region", "region lies outside any image.");
    }
  }
  if (region.width <= 0 || region.height <= 0) {
    ThrowInvalid("region", "region is x,y,width,height in pixels; width and height must be > 0.");
  }
  return region;
}

SearchOptions OptionsOf(const Parameters& parameters, const std::string& collection) {
  SearchOptions options;
  options.collection = collection;
  options.limit = static_cast<std::size_t>(parameters.Integer("limit").value_or(10));
  options.offset = static_cast<std::size_t>(parameters.Integer("offset").value_or(0));
  options.group_by =
      parameters
          .Choice<GroupBy>("group_by", {{"object", GroupBy::kObject}, {"image", GroupBy::kImage}})
          .value_or(options.group_by);
  options.rank = parameters
                     .Choice<RankMethod>("rank", {{"neighbours", RankMethod::kNeighbours},
                                                  {"histogram", RankMethod::kHistogram}})
                     .value_or(options.rank);
  options.verify = parameters
                       .Choice<Verification>(
                           "verify", {{"none", Verification::kNone}, {"tps", Verification::kTps}})
                       .value_or(options.verify);
  options.min_score = parameters.Number("min_score").value_or(0);
  options.object = parameters.Text("object");
  options.verify_depth = static_cast<std::size_t>(parameters.Integer("verify_depth").value_or(0));
  if (const auto expand = parameters.Integer("expand")) {
    options.expand = static_cast<int>(*expand);
  }
  options.max_instances =
      static_cast<int>(parameters.Integer("instances").value_or(options.max_instances));
  if (const auto filter = parameters.Text("filter")) options.filter = FilterOf(*filter);
  options.explain = parameters.Flag("explain").value_or(options.explain);
  options.second_pass = parameters.Flag("closer_look").value_or(options.second_pass);
  if (const auto numbers = parameters.Numbers("region")) options.region = RegionOf(*numbers);
  return options;
}

std::vector<std::string> ExamplesOf(const Parameters& parameters) {
  std::vector<std::string> ids;
  const auto list = parameters.JsonList("image_ids");
  if (!list) return ids;
  if (list->empty() || list->size() > kMaxExamples) {
    ThrowInvalid("image_ids",
                 "image_ids must be 1 to " + std::to_string(kMaxExamples) + " ids of images.");
  }
  for (const Json& id : *list) {
    if (!id.is_string()) ThrowInvalid("image_ids", "image_ids must be texts, ids of images.");
    ids.push_back(id.get<std::string>());
    if (std::count(ids.begin(), ids.end(), ids.back()) > 1) {
      ThrowInvalid("image_ids", "image_ids has an id twice.");
    }
  }
  return ids;
}

// Whether the request has an image, beside its parameters.
bool HasImage(const Request& request, const Parameters& parameters) {
  if (request.content_type == "application/json") {
    return parameters.image_base64() != nullptr || parameters.image_url() != nullptr;
  }
  if (!request.is_multipart()) return request.has_body;
  return std::any_of(request.parts.begin(), request.parts.end(),
                     [](const Part& part) { return part.name == "image"; });
}

}  // namespace

SearchQuery SearchQueryOf(const Request& request, const Parameters& parameters,
                          const std::string& collection, Fetcher& fetcher, Fetcher::For whom) {
  SearchQuery query;
  query.options = OptionsOf(parameters, collection);
  query.image_id = parameters.Text("image_id");
  query.image_ids = ExamplesOf(parameters);
  const bool has_image = HasImage(request, parameters);
  if (query.image_id && has_image) {
    ThrowInvalid("image_id", "image_id and an image exclude each other.");
  }
  if (!query.image_ids.empty() && (query.image_id || has_image)) {
    ThrowInvalid("image_ids", "image_ids excludes image_id and an image.");
  }
  if (!query.image_ids.empty() && query.options.region) {
    ThrowInvalid("region", "region is of one image, and image_ids are several.");
  }
  if (query.image_id) {
    if (parameters.Flag("exclude_self").value_or(true)) query.options.without = {*query.image_id};
  } else if (parameters.has("exclude_self")) {
    ThrowInvalid("exclude_self", "exclude_self goes with image_id alone.");
  }
  if (!query.image_id && query.image_ids.empty()) {
    query.image = ImageOf(request, parameters, fetcher, whom);
  }
  return query;
}

std::vector<Parameter> SearchParameters() {
  return {
      {"image_id", "a stored image to search with, instead of sending one"},
      Parameter("exclude_self", "whether the image of image_id is no hit itself")
          .Boolean()
          .Default("true"),
      Parameter("image_ids",
                "stored images to search with, at most 16: what is like any of them, what is like "
                "several first; they are no hits themselves")
          .JsonList(),
      Parameter("limit", "hits per page; 0 = all").Integer(0, kLargestLimit).Default("10"),
      Parameter("offset", "hits to skip before the page").Integer(0, kLargestOffset).Default("0"),
      Parameter("group_by", "each object once, by its best image, or each image")
          .Choice({"object", "image"})
          .Default("object"),
      Parameter("rank", "votes of nearest neighbours, or the paper's histogram distance")
          .Choice({"neighbours", "histogram"})
          .Default("neighbours"),
      Parameter("verify",
                "whether the best hits must agree with the query on one smooth warp; by "
                "default tps, and none if rank is histogram")
          .Choice({"none", "tps"}),
      Parameter(
          "verify_depth",
          "how many of the best images are verified; by default 30, and up to 100, or the square "
          "root of the collection's size, as far as there are some that agree; twice that where "
          "none "
          "agrees")
          .Integer(1, kLargestDepth),
      Parameter("expand",
                "query expansion: how many of the best verified images are used as further "
                "queries, for views that the query alone does not reach; by default 3 by "
                "image and 0 by object")
          .Integer(0, kMostExpansions),
      Parameter("instances", "maximum number of instances of one object in the query image")
          .Integer(1, kMostInstances)
          .Default("4"),
      Parameter("closer_look",
                "where nothing is found, describe the query image once more at a finer scale, "
                "and give the surer answer; takes three to four times as long; not with image_id "
                "or image_ids")
          .Boolean()
          .Default("true"),
      Parameter("region",
                "x,y,width,height in pixels of the query image: only this part is looked at, in as "
                "many of its own pixels as a whole image may have")
          .Numbers(4),
      Parameter("min_score", "drop hits below it").Number(0, 1).Default("0"),
      {"object", "only images of this object"},
      FilterParameter(),
      Parameter("explain", "explain every hit").Boolean().Default("false")};
}

}  // namespace pliant::server
